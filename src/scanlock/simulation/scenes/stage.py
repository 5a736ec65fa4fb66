"""A world in the making: things put down one by one, each an object of its own."""

import numpy as np

from scanlock.arrays import Points
from scanlock.geometry.pose import Pose
from scanlock.simulation.objects.mover import Mover
from scanlock.simulation.objects.surfaces import Surfaces
from scanlock.simulation.scenes.height_field import HeightField
from scanlock.simulation.world import GROUND_OBJECT, World


class Stage:
    """Collects surfaces and moving objects, and numbers the objects."""

    def __init__(self) -> None:
        self._parts: list[Surfaces] = []
        self._movers: list[Mover] = []
        self._last = GROUND_OBJECT

    def put(self, surfaces: Surfaces, pose: Pose | None = None) -> None:
        """Add one object, given in its own frame and carried to world_from_object."""
        self._last += 1
        self._parts.append(
            (surfaces if pose is None else surfaces.moved(pose)).as_object(self._last)
        )

    def set_going(self, surfaces: Surfaces, path: Points, start: float, speed: float) -> None:
        """Add one moving object; see `Mover`."""
        self._last += 1
        self._movers.append(Mover(surfaces.as_object(self._last), path, start, speed))

    def world(self, ground: HeightField | None) -> World:
        """Return the world of everything that was added."""
        return World.of(self._parts, ground, self._movers)


def around(path: Points) -> Points:
    """Return a closed path that repeats its first corner at the end."""
    return np.vstack([path, path[:1]])
