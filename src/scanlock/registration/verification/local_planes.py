"""Planes fitted to a scan around query points, with the residuals of these points."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Labels, Mask, Matrix, Points, Vector, frozen, read_only, short_repr
from scanlock.clouds.cell_list import CellList
from scanlock.clouds.point_cloud import PointCloud
from scanlock.clouds.voxel_grid import voxel_labels
from scanlock.errors import InvalidInput, require_count, require_fraction, require_positive
from scanlock.geometry.pose import Pose
from scanlock.kernels.gaussians.eigen3 import principal_axes

_MIN_THICKNESS = 0.02
"""Minimum standard deviation of a residual [m]: lidar noise. Few points may lie closer to a plane
by chance."""

_MIN_VARIANCE = 1e-9
"""Minimum variance of points [m^2] along the middle axis; smaller ones are rounding."""

_PACKED_ROWS, _PACKED_COLUMNS = np.triu_indices(3)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class LocalPlanes:
    """Planes fitted to a scan around k of m query points.

    Attributes
    ----------
    has_plane : (m,)
        Whether a plane could be fitted around a query point.
    points : (k, 3) [m]
        Query points with a plane.
    normals : (k, 3)
        Unit normals of the planes, of either sign.
    residuals : (k,) [m]
        Signed distances of the query points from their planes, along the normals.
    normal_covariances : (k, 3, 3)
        Covariances of the normals, from the thickness and the extent of the fitted points.
    flatness : (k,)
        1 minus the ratio of the smallest to the middle variance of the fitted points, in [0, 1].
    thickness : (k,) [m]
        Standard deviation of the residual of one more point of the same surface.
    """

    has_plane: Mask
    points: Points
    normals: Points
    residuals: Vector
    normal_covariances: NDArray[np.float64]
    flatness: Vector
    thickness: Vector

    __repr__ = short_repr

    def __post_init__(self) -> None:
        for one in fields(self):
            frozen(getattr(self, one.name))

    @property
    def rmse(self) -> float:
        """Root mean squared residual [m]; NaN without planes."""
        return math.sqrt(float(np.mean(self.residuals**2))) if len(self.residuals) else math.nan

    @property
    def outlier_ratio(self) -> float:
        """Fraction of residuals above two standard deviations; NaN without planes."""
        if len(self.residuals) == 0:
            return math.nan
        return float(np.mean(self.residuals**2 > 4.0 * (self.thickness**2 + _MIN_THICKNESS**2)))

    def reversed(self, target_from_source: Pose) -> "LocalPlanes":
        """Return planes of the source as constraints in the target's frame.

        The query points are then those of the target. Residuals change sign, so that in either
        direction a motion of the source along a normal increases the residual.
        """
        rotation = target_from_source.rotation
        return LocalPlanes(
            has_plane=self.has_plane,
            points=target_from_source.apply(self.points),
            normals=self.normals @ rotation.T,
            residuals=-self.residuals,
            normal_covariances=rotation @ self.normal_covariances @ rotation.T,
            flatness=self.flatness,
            thickness=self.thickness,
        )


def concatenated(sets: Sequence[LocalPlanes]) -> LocalPlanes:
    """Return the planes of several sets as one, in the order given."""
    return LocalPlanes(
        has_plane=np.concatenate([one.has_plane for one in sets]),
        points=np.concatenate([one.points for one in sets]),
        normals=np.concatenate([one.normals for one in sets]),
        residuals=np.concatenate([one.residuals for one in sets]),
        normal_covariances=np.concatenate([one.normal_covariances for one in sets]),
        flatness=np.concatenate([one.flatness for one in sets]),
        thickness=np.concatenate([one.thickness for one in sets]),
    )


@dataclass(frozen=True, kw_only=True, slots=True)
class LocalPlaneFitter:
    """Settings for query points and for the planes fitted around them."""

    voxel_size: float = 1.0
    """Voxel size [m] of the query points, at most one per voxel: near walls must not dominate."""

    max_points: int = 300
    """Maximum number of query points of a scan, evenly distributed over its voxels."""

    sample_size: int = 10000
    """Number of points of the scan, evenly spaced by row, from which query points are chosen."""

    radii: tuple[float, ...] = (0.5, 1.0, 2.0)
    """Radii of the neighbourhoods of a query point [m], ascending. The plane is fitted in the first
    with enough points: tightly on near walls, widely on distant ground."""

    min_points: int = 8
    """Minimum number of points of a plane; fewer fit planes across corners."""

    min_eigenvalue_ratio: float = 0.1
    """Minimum ratio of the middle to the largest variance of the points; less is a line."""

    def __post_init__(self) -> None:
        require_positive("voxel_size", self.voxel_size, unit="m")
        if not self.radii:
            raise InvalidInput("radii must have at least one radius, got ()")
        for radius in self.radii:
            require_positive("radii", radius, unit="m")
        require_count("max_points", self.max_points)
        require_count("sample_size", self.sample_size)
        require_count("min_points", self.min_points, minimum=4)
        require_fraction("min_eigenvalue_ratio", self.min_eigenvalue_ratio)

    def query_points(self, cloud: PointCloud) -> Points:
        """Return (m, 3) evenly distributed points of a cloud [m]."""
        rows = np.flatnonzero(cloud.is_measured)
        points = cloud.points[_evenly_spaced(rows, self.sample_size)]
        if len(points) == 0:
            return read_only(points)
        labels, count = voxel_labels(points, self.voxel_size)
        firsts = np.empty(count, np.int64)
        firsts[labels[::-1]] = np.arange(len(labels))[::-1]
        return read_only(points[_evenly_spaced(firsts, self.max_points)])

    def cell_list(self, cloud: PointCloud) -> CellList:
        """Return the cell list of a cloud, for `fit`."""
        return CellList.of_points(cloud.points, 2.0 * min(self.radii))

    def fit(self, points: CellList, query_points: Points) -> LocalPlanes:
        """Fit planes to a scan around (m, 3) query points [m] in its frame.

        The planes are ordered by the radius of their neighbourhood.
        """
        left = np.arange(len(query_points))
        rows, fits = [], []
        for radius in self.radii:
            fit, is_plane = self._eigen_fits(points.sums_within_radius(query_points[left], radius))
            rows.append(left[is_plane])
            fits.append(fit[is_plane])
            left = left[~is_plane]
        has_plane = np.ones(len(query_points), np.bool_)
        has_plane[left] = False
        return _local_planes(query_points[np.concatenate(rows)], np.concatenate(fits), has_plane)

    def _eigen_fits(self, sums: Matrix) -> tuple[Matrix, Mask]:
        """Return the moments of neighbourhoods, and which of them are planes.

        From (m, 10) sums over the offsets from the query points: (m, 16) counts, mean offsets,
        ascending variances and principal axes.
        """
        counts = np.maximum(sums[:, :1], 1.0)
        means = sums[:, 1:4] / counts
        packed = sums[:, 4:] / counts - means[:, _PACKED_ROWS] * means[:, _PACKED_COLUMNS]
        variances, axes = principal_axes(read_only(packed))
        min_middle = np.maximum(self.min_eigenvalue_ratio * variances[:, 2], _MIN_VARIANCE)
        fits = np.hstack([counts, means, np.maximum(variances, 0.0), axes])
        return fits, (variances[:, 1] > min_middle) & (sums[:, 0] >= self.min_points)


def _local_planes(points: Points, fits: Matrix, has_plane: Mask) -> LocalPlanes:
    """Return the planes of (k, 16) moments around (k, 3) query points."""
    counts, means, variances = fits[:, 0], fits[:, 1:4], fits[:, 4:7]
    axes = fits[:, 7:].reshape(-1, 3, 3)
    normals = np.ascontiguousarray(axes[:, 0])
    return LocalPlanes(
        has_plane=has_plane,
        points=points,
        normals=normals,
        residuals=-(means * normals).sum(axis=1),
        normal_covariances=_normal_covariances(variances, axes, counts),
        flatness=1.0 - variances[:, 0] / variances[:, 1],
        thickness=_prediction_deviations(variances[:, 0], counts),
    )


def _normal_covariances(
    variances: Matrix, axes: NDArray[np.float64], counts: Vector
) -> NDArray[np.float64]:
    """Return the (k, 3, 3) covariances of the normals of planes fitted by least squares.

    The variance of the angle about an in-plane axis is ``v_normal / (n v_other)``, with the
    variances along the normal and along the other in-plane axis, and n points.
    """
    rotations = (variances[:, 0] / counts)[:, None] / variances[:, 1:]
    in_plane = axes[:, 1:]
    return (in_plane * rotations[:, :, None]).transpose(0, 2, 1) @ in_plane


def _prediction_deviations(variances: Vector, counts: Vector) -> Vector:
    """Return (k,) standard deviations of one more point from planes with three parameters."""
    return np.sqrt(variances * counts / (counts - 3.0) * (1.0 + 1.0 / counts))


def _evenly_spaced(rows: Labels, max_count: int) -> Labels:
    """Return at most `max_count` of the rows, evenly spaced."""
    if len(rows) <= max_count:
        return rows
    return rows[np.linspace(0, len(rows) - 1, max_count).astype(np.int64)]
