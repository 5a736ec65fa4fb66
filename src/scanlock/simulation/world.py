"""A world of surfaces, ground and moving objects, and what rays meet in it."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector, frozen, read_only
from scanlock.errors import InvalidInput, require_positive
from scanlock.kernels.simulation.ray_casting import NOTHING, cast_at_movers, cast_rays
from scanlock.kernels.simulation.ray_ground import cast_at_ground
from scanlock.kernels.simulation.ray_tree import box_tree
from scanlock.simulation.objects.mover import Mover
from scanlock.simulation.objects.surface_class import SurfaceClass
from scanlock.simulation.objects.surfaces import Surfaces
from scanlock.simulation.scenes.height_field import HeightField

GROUND_OBJECT = 0
"""The object number of the height field."""


@dataclass(frozen=True, slots=True, eq=False)
class RayHits:
    """What each of n rays met first.

    Attributes
    ----------
    distances : (n,) [m]
        Infinite where a ray met nothing.
    cosines : (n,)
        Between ray and surface normal, in [0, 1]; 0 where a ray met nothing.
    labels, objects : (n,)
        `SurfaceClass` and object number; -1 where a ray met nothing.
    losses : (n,)
        The share of pulses that the surface swallows.
    """

    distances: Vector
    cosines: Vector
    labels: Labels
    objects: Labels
    losses: Vector

    def __post_init__(self) -> None:
        for array in (self.distances, self.cosines, self.labels, self.objects, self.losses):
            frozen(array)

    def limits(self, reach: float) -> Vector:
        """Return how far (n,) a ray must look to find something nearer [m]."""
        return read_only(np.minimum(self.distances, reach))

    def overlaid(self, cast: tuple[Vector, Vector, Labels], surfaces: Surfaces) -> "RayHits":
        """Return these hits with the nearer ones of a cast in their place.

        `cast` is distances, cosines and rows of `surfaces`, as the kernels return them.
        """
        met = cast[2] != NOTHING
        rows = cast[2][met]
        distances, cosines, losses = self.distances.copy(), self.cosines.copy(), self.losses.copy()
        labels, objects = self.labels.copy(), self.objects.copy()
        distances[met], cosines[met] = cast[0][met], cast[1][met]
        labels[met], objects[met] = surfaces.labels[rows], surfaces.objects[rows]
        losses[met] = surfaces.losses[rows]
        return RayHits(distances, cosines, labels, objects, losses)


@dataclass(frozen=True, slots=True, eq=False)
class World:
    """Everything that a sensor can see. Build one with `World.of`.

    Attributes
    ----------
    surfaces : Surfaces
        What stands still, in the order of the tree over it.
    ground : HeightField or None
        The terrain; its points are `SurfaceClass.GROUND` of object 0.
    movers : tuple of Mover
        What moves.
    """

    surfaces: Surfaces
    ground: HeightField | None
    movers: tuple[Mover, ...]
    _node_bounds: Matrix
    _node_link: Labels
    _node_count: Labels

    @classmethod
    def of(
        cls,
        surfaces: Surfaces | Iterable[Surfaces] = (),
        ground: HeightField | None = None,
        movers: Iterable[Mover] = (),
    ) -> "World":
        """Return the world of some standing surfaces, a ground and moving objects."""
        if not isinstance(surfaces, Surfaces):
            surfaces = Surfaces.joined(surfaces)
        order, bounds, link, count = box_tree(read_only(surfaces.bounds()))
        return cls(
            surfaces.taken(order),
            ground,
            tuple(movers),
            read_only(bounds),
            read_only(link),
            read_only(count),
        )

    def cast(
        self, origins: Points, directions: Points, time: float, delays: Vector, reach: float
    ) -> RayHits:
        """Return what (n, 3) rays meet first within `reach` [m].

        Parameters
        ----------
        origins, directions : (n, 3) [m]
            Directions are unit vectors.
        time : float [s]
            When the moving objects are looked up; each keeps its velocity over all delays.
        delays : (n,) [s]
            When each ray is fired, after `time`; negative before it.
        reach : float [m]
            How far rays look.

        Raises
        ------
        InvalidInput
            Shapes that do not go together, or a reach that is not positive.
        """
        require_positive("reach", reach, unit="m")
        n = len(origins)
        if origins.shape != (n, 3) or directions.shape != (n, 3) or delays.shape != (n,):
            raise InvalidInput(
                "origins and directions must have shape (n, 3) and delays (n,), got "
                f"{origins.shape}, {directions.shape} and {delays.shape}"
            )
        origins, directions, delays = (
            read_only(np.asarray(array, np.float64)) for array in (origins, directions, delays)
        )
        hits = self._at_ground(origins, directions, reach)
        hits = hits.overlaid(
            cast_rays(
                origins,
                directions,
                hits.limits(reach),
                self.surfaces.kinds,
                self.surfaces.rows,
                self._node_bounds,
                self._node_link,
                self._node_count,
            ),
            self.surfaces,
        )
        near = self._movers_near(origins, time, delays, reach)
        if near is None:
            return hits
        moving, first, frames = near
        limits = hits.limits(reach)
        return hits.overlaid(
            cast_at_movers(
                origins, directions, delays, limits, moving.kinds, moving.rows, first, frames
            ),
            moving,
        )

    def _at_ground(self, origins: Points, directions: Points, reach: float) -> RayHits:
        n = len(origins)
        distances, cosines = np.full(n, np.inf), np.zeros(n)
        if self.ground is not None:
            distances, cosines = cast_at_ground(
                origins,
                directions,
                read_only(np.full(n, reach)),
                self.ground.heights,
                self.ground.tops,
                self.ground.corner,
                self.ground.cell,
            )
        met = np.isfinite(distances)
        labels = np.where(met, int(SurfaceClass.GROUND), NOTHING)
        return RayHits(
            distances, cosines, labels, np.where(met, GROUND_OBJECT, NOTHING), np.zeros(n)
        )

    def _movers_near(
        self, origins: Points, time: float, delays: Vector, reach: float
    ) -> tuple[Surfaces, Labels, Matrix] | None:
        """Return surfaces, first rows and frames of the movers that rays may meet, if any."""
        if len(origins) == 0:
            return None
        low, high = origins.min(axis=0), origins.max(axis=0)
        near: list[Surfaces] = []
        frames: list[Vector] = []
        for mover in self.movers:
            pose, velocity = mover.at(time)
            way = mover.speed * float(np.abs(delays).max())
            gap = np.maximum(np.maximum(low - pose.translation, pose.translation - high), 0.0)
            if float(np.linalg.norm(gap)) <= reach + mover.radius + way:
                near.append(mover.surfaces)
                rotation = pose.rotation.T.ravel()
                frames.append(
                    np.concatenate([pose.translation, rotation, velocity, [mover.radius]])
                )
        if not near:
            return None
        first = np.zeros(len(near) + 1, np.int64)
        first[1:] = np.cumsum([len(surfaces) for surfaces in near])
        return Surfaces.joined(near), read_only(first), read_only(np.array(frames))
