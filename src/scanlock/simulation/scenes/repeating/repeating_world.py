"""Worlds that repeat, with places for a sensor, and the builder of their loose things."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Matrix, Points, frozen, read_only, short_repr
from scanlock.errors import require_at_least
from scanlock.geometry.pose import Pose
from scanlock.simulation.objects.surfaces import Surfaces
from scanlock.simulation.scenes.repeating.visit import Visit
from scanlock.simulation.scenes.site import upright_pose
from scanlock.simulation.scenes.world_builder import WorldBuilder
from scanlock.simulation.terrain.height_field import HeightField
from scanlock.simulation.world import World

HALF_LENGTH = 250.0
"""Half side of the ground [m]; sensors see up to 200 m from the middle."""

MakeThing = Callable[[np.random.Generator], Surfaces]
"""Function that generates a loose thing."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class RepeatingWorld:
    """A world whose structure repeats, with loose things in it.

    Attributes
    ----------
    kind : str
        Name of the function that generated it.
    world : World
    places : (n, 3) [m]
        Places on the floor that are free of things, in order along the middle of the world.
    sensor_height : float [m]
        Usual height of a sensor above the floor.
    symmetry : Pose or None
        A motion of the world that maps its structure, but not its loose things, to itself: one
        period along a row, one storey, a quarter turn; None if there is none. It does not hold for
        the ends of a row.
    """

    kind: str
    world: World
    places: Points
    sensor_height: float
    symmetry: Pose | None

    __repr__ = short_repr

    def __post_init__(self) -> None:
        frozen(self.places)


class ThingDealer:
    """Builder of a world, which deals loose things to numbered places.

    Attributes
    ----------
    builder : WorldBuilder
        Builder of the structure too.
    """

    def __init__(self, visit: Visit, things: float) -> None:
        require_at_least("things", things, 0.0)
        self.builder = WorldBuilder()
        self._visit = visit
        self._things = things
        self._place = 0

    def deal(
        self,
        position: Sequence[float],
        makes: Sequence[MakeThing],
        *,
        chance: float,
        yaw: float = 0.0,
        shift: tuple[float, float] = (0.0, 0.0),
        turn: float = math.pi,
    ) -> None:
        """Deal a random thing, or none, to the next place.

        Parameters
        ----------
        position : (3,) [m]
            Middle of the place, on the floor.
        makes : sequence of callable
            Functions that generate the things to choose from.
        chance : float
            Probability of a thing, before the factor of the world.
        yaw : float [rad]
            Direction of the x axis of the thing.
        shift : (2,) [m]
            Maximum random shift along and across that direction.
        turn : float [rad]
            Maximum random turn.
        """
        rng = self._visit.place_rng(self._place)
        self._place += 1
        if rng.random() >= chance * self._things:
            return
        thing = makes[int(rng.integers(len(makes)))](rng)
        along, across = rng.uniform(-1.0, 1.0, 2) * shift
        cos, sin = math.cos(yaw), math.sin(yaw)
        offset = [cos * along - sin * across, sin * along + cos * across, 0.0]
        pose = upright_pose(np.add(position, offset), yaw + turn * rng.uniform(-1.0, 1.0))
        self.builder.add(thing, pose)

    def finished(
        self, kind: str, places: Matrix, sensor_height: float, symmetry: Pose | None
    ) -> RepeatingWorld:
        """Return the world of all that was added, on level ground."""
        return RepeatingWorld(
            kind=kind,
            world=self.builder.world(HeightField.level(HALF_LENGTH)),
            places=read_only(np.array(places, np.float64)),
            sensor_height=sensor_height,
            symmetry=symmetry,
        )


def lane(low: float, high: float, y: float = 0.0, z: float = 0.0) -> Points:
    """Return places every metre along x, from `low` to `high` [m], of one y and z."""
    x = np.arange(low, high, 1.0)
    return np.column_stack([x, np.full(len(x), y), np.full(len(x), z)])


def shifted(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Pose:
    """Return a motion without a rotation [m]."""
    return Pose(np.eye(3), np.array([x, y, z], np.float64))


def stations(spacing: float, half_length: float) -> list[float]:
    """Return the multiples of `spacing` within +-`half_length` [m]."""
    count = math.floor(half_length / spacing + 1e-9)
    return [spacing * index for index in range(-count, count + 1)]
