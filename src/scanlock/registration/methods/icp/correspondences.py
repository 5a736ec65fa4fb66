"""Correspondences between two scans: search, rejection by distance and robust weights.

Step 1 of ICP (Madhavan and Messina 2003, section 2.1) and of generalised ICP (Segal et al. 2009,
Algorithm 1). The search, the rejection and the weights are independent of each other.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, Protocol, get_args

import numpy as np

from scanlock.arrays import Labels, Mask, Matrix, Points, Vector, frozen, read_only
from scanlock.clouds.cached_neighbours import cached_neighbours
from scanlock.clouds.neighbours import NearestNeighbours, Search, nearest_neighbours
from scanlock.clouds.point_tree import PointTree
from scanlock.errors import InvalidInput
from scanlock.models.surface_points import SurfacePoints, SurfaceVoxels
from scanlock.registration.methods.gaussian_scan import require_coarse_to_fine
from scanlock.registration.methods.icp.distance_rejection import Rejection
from scanlock.registration.methods.protocol import InsufficientData

Residual = Literal["point-to-point", "point-to-plane"]
"""Residual of a correspondence: its distance, or the component along the normal of the target."""

MIN_CORRESPONDENCES = 10
"""Minimum number of points of a scan, and of correspondences of a pose."""

_SHELLS = 10
"""Number of shells of equal count around the sensor for the typical spacing of a scan."""


@dataclass(frozen=True, slots=True, eq=False)
class Correspondences:
    """Correspondences at one pose. Build with `find_correspondences`.

    Attributes
    ----------
    target_rows, source_rows : (m,)
        Rows of the target point and of the source point of each correspondence.
    distances : (m,) [m]
        Distance of each correspondence.
    weights : (m,)
        Robust weights in [0, 1].
    threshold : float [m]
        Distance above which correspondences were rejected.
    """

    target_rows: Labels
    source_rows: Labels
    distances: Vector
    weights: Vector
    threshold: float

    def __post_init__(self) -> None:
        for array in (self.target_rows, self.source_rows, self.distances, self.weights):
            frozen(array)

    def __len__(self) -> int:
        return len(self.target_rows)

    @property
    def mean_distance(self) -> float:
        """Unweighted mean of the distances [m]; NaN without correspondences."""
        return float(self.distances.mean()) if len(self) else math.nan

    @property
    def weighted_count(self) -> int:
        """Number of correspondences with a positive weight."""
        return int(np.count_nonzero(self.weights))

    def selected(self, mask: Mask) -> "Correspondences":
        """Return the correspondences of an (m,) mask."""
        return Correspondences(
            read_only(self.target_rows[mask]),
            read_only(self.source_rows[mask]),
            self.distances[mask],
            self.weights[mask],
            self.threshold,
        )

    def weighted(self, weights: Vector) -> "Correspondences":
        """Return the correspondences with these (m,) weights."""
        return replace(self, weights=weights)


def find_correspondences(
    target: NearestNeighbours,
    source: Points,
    rejection: Rejection | None = None,
    *,
    max_distance: float = math.inf,
    spacing: float = 0.0,
    previous: float = math.inf,
    max_threshold: float = math.inf,
) -> Correspondences:
    """Return the correspondences of source points that a search finds and a rejection keeps.

    Parameters
    ----------
    target : NearestNeighbours
        Search over the target.
    source : (n, 3) [m]
        Points of the source in the frame of the target.
    rejection : Rejection, optional
        Computes the threshold; none by default.
    max_distance : float [m]
        Source points without a target point within this distance have no correspondence and do not
        enter the statistics of the rejection.
    spacing, previous : float [m]
        As for `Rejection.threshold`.
    max_threshold : float [m]
        Upper bound of the threshold.
    """
    if rejection is not None:
        max_distance = min(max_distance, rejection.max_distance)
    target_rows, distances = target.nearest(source, max_distance)
    source_rows = np.flatnonzero(target_rows >= 0)
    threshold = min(max_distance, max_threshold)
    if rejection is not None:
        threshold = previous
        if len(source_rows):
            threshold = rejection.threshold(distances[source_rows], previous, spacing)
            threshold = min(threshold, max_threshold)
    if threshold < max_distance:
        source_rows = source_rows[distances[source_rows] <= threshold]
    return Correspondences(
        read_only(target_rows[source_rows]),
        read_only(source_rows),
        distances[source_rows],
        np.ones(len(source_rows)),
        threshold,
    )


@dataclass(frozen=True, slots=True, eq=False)
class SearchStage:
    """A target prepared for one stage of a search.

    Attributes
    ----------
    surface : SurfacePoints
        Target points with the covariances of their surfaces.
    closest : NearestNeighbours
        Search over these points.
    max_distance : float [m]
        Maximum distance of a correspondence.
    scale : float [m]
        The maximum distance or the voxel size of the stage.
    spacing : float [m]
        Typical distance between neighbouring points.
    """

    surface: SurfacePoints
    closest: NearestNeighbours
    max_distance: float
    scale: float
    spacing: float


class CorrespondenceSearch(Protocol):
    """Settings of the search for the target point of each source point, coarse to fine."""

    @property
    def scales(self) -> tuple[float, ...]:
        """Scale of each stage [m], coarse to fine: maximum distance or voxel size."""
        ...

    def stages(
        self, tree: PointTree, surface: SurfacePoints, spacing: float
    ) -> tuple[SearchStage, ...]:
        """Return the target prepared for each stage.

        Parameters
        ----------
        tree : PointTree
            Search tree of the target.
        surface : SurfacePoints
            The points of the tree with their covariances.
        spacing : float [m]
            Typical distance between neighbouring points.
        """
        ...


@dataclass(frozen=True, kw_only=True, slots=True)
class NearestNeighbourSearch:
    """Search for the nearest target point within a maximum distance."""

    max_correspondence_distances: tuple[float, ...] = (20.0, 5.0, 1.0)
    """Maximum distance of a correspondence at each stage [m], coarse to fine. Each stage starts
    from the pose of the previous one. Segal et al. call it d_max."""

    algorithm: Search = "k-d tree"
    """Data structure of the search; the results are equal."""

    def __post_init__(self) -> None:
        require_coarse_to_fine("max_correspondence_distances", self.max_correspondence_distances)
        require_algorithm("algorithm", self.algorithm)

    @property
    def scales(self) -> tuple[float, ...]:
        """The maximum distances [m]."""
        return self.max_correspondence_distances

    def stages(
        self, tree: PointTree, surface: SurfacePoints, spacing: float
    ) -> tuple[SearchStage, ...]:
        """Return the same search for every stage."""
        closest = nearest_neighbours(tree, self.algorithm)
        return tuple(SearchStage(surface, closest, scale, scale, spacing) for scale in self.scales)


@dataclass(frozen=True, kw_only=True, slots=True)
class VoxelSearch:
    """Search for the target voxel that contains a source point (Koide et al. 2021)."""

    voxel_sizes: tuple[float, ...] = (8.0, 4.0, 2.0, 1.0)
    """Voxel size at each stage [m], coarse to fine. Each stage starts from the pose of the previous
    one. The size limits the distance of a correspondence."""

    def __post_init__(self) -> None:
        require_coarse_to_fine("voxel_sizes", self.voxel_sizes)

    @property
    def scales(self) -> tuple[float, ...]:
        """The voxel sizes [m]."""
        return self.voxel_sizes

    def stages(
        self, tree: PointTree, surface: SurfacePoints, spacing: float
    ) -> tuple[SearchStage, ...]:
        """Return the voxels of each size, whose spacing is their size."""
        voxels = [SurfaceVoxels.from_points(surface, size) for size in self.voxel_sizes]
        return tuple(
            SearchStage(one.surface, ContainingVoxels(one), math.inf, one.size, one.size)
            for one in voxels
        )


@dataclass(frozen=True, slots=True, eq=False)
class ContainingVoxels:
    """The means of voxels, searched by the voxel that contains a point."""

    voxels: SurfaceVoxels

    @property
    def points(self) -> Points:
        """(k, 3) means of the voxels [m]."""
        return self.voxels.surface.points

    def nearest(self, queries: Points, max_distance: float = math.inf) -> tuple[Labels, Vector]:
        """Return the row of the voxel of each of (m, 3) points, and the distance to its mean [m].

        The row is -1 and the distance infinite where the voxel is empty or its mean is not nearer
        than `max_distance`.
        """
        rows = self.voxels.rows_of(queries)
        # Several times as fast as indexing and a norm along the rows.
        differences = queries - np.take(self.points, rows, axis=0, mode="clip")
        differences *= differences
        distances = np.sqrt(differences @ np.ones(3))
        is_missing = (rows < 0) | (distances >= max_distance)
        rows[is_missing], distances[is_missing] = -1, math.inf
        return rows, distances


def cached_stages(stages: Sequence[SearchStage]) -> list[SearchStage]:
    """Return stages with searches that are fast for queries that move little between calls.

    Stages with the same search share the cache. The answers do not change.
    """
    searches = {id(stage.closest): cached_neighbours(stage.closest) for stage in stages}
    return [replace(stage, closest=searches[id(stage.closest)]) for stage in stages]


@dataclass(frozen=True, slots=True, eq=False)
class PointScan:
    """A scan prepared for ICP.

    Attributes
    ----------
    closest : NearestNeighbours
        Search over the points of the scan.
    spacing : float [m]
        Typical distance between neighbouring points, see `typical_spacing`.
    normals : (n, 3)
        Unit normals of the surface at each point; (0, 3) if the settings need none.
    covariances : (n, 6) [m^2]
        Packed covariances of the sensor noise at each point; (0, 6) without a noise model.
    sample : (k, 3) [m]
        Points for simulated annealing; (0, 3) without it.
    """

    closest: NearestNeighbours
    spacing: float
    normals: Points
    covariances: Matrix
    sample: Points

    def __post_init__(self) -> None:
        for array in (self.normals, self.covariances, self.sample):
            frozen(array)

    @property
    def points(self) -> Points:
        """(n, 3) points [m], all of the scan or downsampled."""
        return self.closest.points


def require_algorithm(name: str, algorithm: str) -> None:
    """Raise `InvalidInput` for an unknown algorithm of the nearest-neighbour search."""
    if algorithm not in get_args(Search):
        choices = " or ".join(map(repr, get_args(Search)))
        raise InvalidInput(f"{name} must be {choices}, got {algorithm!r}")


def require_points(count: int, name: str = "points") -> None:
    """Raise `InsufficientData` for fewer than `MIN_CORRESPONDENCES` points."""
    if count < MIN_CORRESPONDENCES:
        raise InsufficientData(f"has {count} {name}; {MIN_CORRESPONDENCES} are needed")


def typical_spacing(tree: PointTree) -> float:
    """Return the typical distance between neighbouring points [m].

    The mean, over ten shells of equal count around the sensor, of the median distance of a point to
    its nearest neighbour. Scans are dense near the sensor and sparse far away: the median of all
    points would be that of near ones, and the mean that of outliers.
    """
    if len(tree) < 2:
        return 0.0
    other = tree.points[tree.neighbours(2)[:, 1]]
    spacings = np.linalg.norm(tree.points - other, axis=1)
    order = np.argsort(np.linalg.norm(tree.points, axis=1))
    shells = np.array_split(spacings[order], min(_SHELLS, len(tree)))
    return float(np.mean([np.median(shell) for shell in shells]))
