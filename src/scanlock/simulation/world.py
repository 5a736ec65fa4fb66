"""Simulated world of surfaces, terrain and moving objects, with ray casting."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector, frozen, read_only, short_repr
from scanlock.errors import InvalidInput, require_positive
from scanlock.kernels.simulation.ray_casting import NOTHING, cast_at_movers, cast_rays
from scanlock.kernels.simulation.ray_ground import cast_at_ground
from scanlock.kernels.simulation.ray_tree import box_tree
from scanlock.simulation.objects.mover import Mover
from scanlock.simulation.objects.surface_class import SurfaceClass
from scanlock.simulation.objects.surfaces import Surfaces
from scanlock.simulation.terrain.height_field import HeightField

GROUND_OBJECT = 0
"""Object number of the terrain."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class RayHits:
    """First intersection of each of n rays with a world.

    Attributes
    ----------
    distances : (n,) [m]
        Infinite for rays without an intersection.
    cosines : (n,)
        Absolute cosine between the ray and the surface normal; 0 without an intersection.
    labels, objects : (n,)
        `SurfaceClass` and object number; -1 without an intersection.
    losses : (n,)
        Ratio of pulses that the surface does not return.
    """

    distances: Vector
    cosines: Vector
    labels: Labels
    objects: Labels
    losses: Vector

    def __post_init__(self) -> None:
        for array in (self.distances, self.cosines, self.labels, self.objects, self.losses):
            frozen(array)

    def max_distances(self, max_range: float) -> Vector:
        """Return the (n,) distances [m] below which another surface would be hit first."""
        return read_only(np.minimum(self.distances, max_range))

    def with_nearer(self, cast: tuple[Vector, Vector, Labels], surfaces: Surfaces) -> "RayHits":
        """Return a copy in which the hits of a cast replace those of the same rays.

        Parameters
        ----------
        cast : tuple of (n,) arrays
            Distances, cosines and rows of `surfaces`, as returned by the kernels.
        surfaces : Surfaces
        """
        is_hit = cast[2] != NOTHING
        rows = cast[2][is_hit]
        distances, cosines, losses = self.distances.copy(), self.cosines.copy(), self.losses.copy()
        labels, objects = self.labels.copy(), self.objects.copy()
        distances[is_hit], cosines[is_hit] = cast[0][is_hit], cast[1][is_hit]
        labels[is_hit], objects[is_hit] = surfaces.labels[rows], surfaces.objects[rows]
        losses[is_hit] = surfaces.losses[rows]
        return RayHits(
            distances=distances, cosines=cosines, labels=labels, objects=objects, losses=losses
        )


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class World:
    """Surfaces, terrain and moving objects; build one with `World.of`.

    Attributes
    ----------
    surfaces : Surfaces
        Static surfaces, in the order of the tree over them.
    ground : HeightField or None
        Terrain; its points are `SurfaceClass.GROUND` of object 0.
    movers : tuple of Mover
        Moving objects.
    """

    surfaces: Surfaces
    ground: HeightField | None
    movers: tuple[Mover, ...]
    _node_bounds: Matrix
    _node_link: Labels
    _node_count: Labels

    __repr__ = short_repr

    @classmethod
    def of(
        cls,
        surfaces: Surfaces | Iterable[Surfaces] = (),
        ground: HeightField | None = None,
        movers: Iterable[Mover] = (),
    ) -> "World":
        """Build a world.

        Parameters
        ----------
        surfaces : Surfaces or iterable of Surfaces
            Static surfaces.
        ground : HeightField, optional
            Terrain.
        movers : iterable of Mover
            Moving objects.
        """
        if not isinstance(surfaces, Surfaces):
            surfaces = Surfaces.joined(surfaces)
        order, bounds, link, count = box_tree(read_only(surfaces.bounds()))
        return cls(
            surfaces=surfaces.taken(order),
            ground=ground,
            movers=tuple(movers),
            _node_bounds=read_only(bounds),
            _node_link=read_only(link),
            _node_count=read_only(count),
        )

    def cast(
        self, origins: Points, directions: Points, time: float, delays: Vector, max_range: float
    ) -> RayHits:
        """Cast rays and find the first intersection of each.

        Parameters
        ----------
        origins, directions : (n, 3) [m]
            Directions are unit vectors.
        time : float [s]
            Time at which positions and velocities of moving objects are taken; velocities are
            constant over the delays.
        delays : (n,) [s]
            Time of each ray relative to `time`.
        max_range : float [m]
            Length of the rays.

        Raises
        ------
        InvalidInput
            Arrays of inconsistent shapes, or a range that is not positive.
        """
        require_positive("max_range", max_range, unit="m")
        n = len(origins)
        if origins.shape != (n, 3) or directions.shape != (n, 3) or delays.shape != (n,):
            raise InvalidInput(
                "origins and directions must have shape (n, 3) and delays (n,), got "
                f"{origins.shape}, {directions.shape} and {delays.shape}"
            )
        origins, directions, delays = (
            read_only(np.asarray(array, np.float64)) for array in (origins, directions, delays)
        )
        hits = self._ground_hits(origins, directions, max_range)
        hits = hits.with_nearer(
            cast_rays(
                origins,
                directions,
                hits.max_distances(max_range),
                self.surfaces.kinds,
                self.surfaces.rows,
                self._node_bounds,
                self._node_link,
                self._node_count,
            ),
            self.surfaces,
        )
        near = self._movers_near(origins, time, delays, max_range)
        if near is None:
            return hits
        moving, first, frames = near
        limits = hits.max_distances(max_range)
        return hits.with_nearer(
            cast_at_movers(
                origins, directions, delays, limits, moving.kinds, moving.rows, first, frames
            ),
            moving,
        )

    def _ground_hits(self, origins: Points, directions: Points, max_range: float) -> RayHits:
        n = len(origins)
        distances, cosines = np.full(n, np.inf), np.zeros(n)
        if self.ground is not None:
            distances, cosines = cast_at_ground(
                origins,
                directions,
                read_only(np.full(n, max_range)),
                self.ground.heights,
                self.ground.tops,
                self.ground.corner,
                self.ground.cell,
            )
        is_hit = np.isfinite(distances)
        return RayHits(
            distances=distances,
            cosines=cosines,
            labels=np.where(is_hit, int(SurfaceClass.GROUND), NOTHING),
            objects=np.where(is_hit, GROUND_OBJECT, NOTHING),
            losses=np.zeros(n),
        )

    def _movers_near(
        self, origins: Points, time: float, delays: Vector, max_range: float
    ) -> tuple[Surfaces, Labels, Matrix] | None:
        """Return surfaces, first rows and frames of the movers within range; None if none is."""
        if len(origins) == 0:
            return None
        low, high = origins.min(axis=0), origins.max(axis=0)
        near: list[Surfaces] = []
        frames: list[Vector] = []
        for mover in self.movers:
            pose, velocity = mover.at(time)
            shift = mover.speed * float(np.abs(delays).max())
            offset = np.maximum(np.maximum(low - pose.translation, pose.translation - high), 0.0)
            if float(np.linalg.norm(offset)) <= max_range + mover.radius + shift:
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
