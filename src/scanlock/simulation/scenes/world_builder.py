"""Builder of worlds from single objects."""

import numpy as np

from scanlock.arrays import Points
from scanlock.geometry.pose import Pose
from scanlock.simulation.objects.mover import Mover
from scanlock.simulation.objects.surfaces import Surfaces
from scanlock.simulation.terrain.height_field import HeightField
from scanlock.simulation.world import GROUND_OBJECT, World


class WorldBuilder:
    """Collector of static and moving objects, which it numbers from 1 on."""

    def __init__(self) -> None:
        self._parts: list[Surfaces] = []
        self._movers: list[Mover] = []
        self._last = GROUND_OBJECT

    def add(self, surfaces: Surfaces, pose: Pose | None = None) -> None:
        """Add a static object with the pose ``world_from_object``; the identity by default."""
        self._last += 1
        self._parts.append(
            (surfaces if pose is None else surfaces.moved(pose)).as_object(self._last)
        )

    def add_mover(self, surfaces: Surfaces, path: Points, start: float, speed: float) -> None:
        """Add a moving object; see `Mover`."""
        self._last += 1
        self._movers.append(
            Mover(surfaces=surfaces.as_object(self._last), path=path, start=start, speed=speed)
        )

    def world(self, ground: HeightField | None) -> World:
        """Return the world of all objects that were added."""
        return World.of(self._parts, ground, self._movers)


def closed(path: Points) -> Points:
    """Return a path closed by repeating its first corner at the end."""
    return np.vstack([path, path[:1]])
