"""How far some points of one scan lie from the surface of another: a plane fitted at each."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Labels, Mask, Matrix, Points, Vector, frozen, read_only
from scanlock.clouds.cell_list import CellList
from scanlock.clouds.point_cloud import PointCloud
from scanlock.clouds.voxel_grid import voxel_labels
from scanlock.errors import InvalidInput, require_count, require_fraction, require_positive
from scanlock.geometry.pose import Pose
from scanlock.kernels.gaussians.eigen3 import principal_axes


@dataclass(frozen=True, slots=True, eq=False)
class LocalPlanes:
    """The surface of a scan near m probes, where it is known: at k of them.

    Attributes
    ----------
    met : (m,)
        Whether the scan has points enough about a probe, off a line, to fit a plane to.
    places : (k, 3) [m]
        The probes that are met.
    normals : (k, 3)
        Unit normals of the planes, of either sign.
    gaps : (k,) [m]
        Signed distances of the probes from their planes, along the normals.
    doubts : (k, 3, 3)
        Covariance of each normal, from the thickness and the extent of what it was fitted to.
    flatness : (k,)
        How much of a plane it is: 1 less the variance across over that along its narrower side,
        in [0, 1].
    thickness : (k,) [m]
        Standard deviation that a gap would have if the probe were one more point of what the
        plane was fitted to.
    """

    has_plane: Mask
    points: Points
    normals: Points
    residuals: Vector
    normal_covariances: NDArray[np.float64]
    flatness: Vector
    thickness: Vector

    def __post_init__(self) -> None:
        for array in (
            self.has_plane, self.points, self.normals, self.residuals, self.normal_covariances,
            self.flatness, self.thickness,
        ):  # fmt: skip
            frozen(array)

    @property
    def roughness(self) -> float:
        """Root mean squared gap [m]; NaN where nothing is met."""
        return math.sqrt(float(np.mean(self.residuals**2))) if len(self.residuals) else math.nan

    @property
    def outlier_ratio(self) -> float:
        """Share of the gaps that are more than twice what belongs there; NaN without any."""
        if len(self.residuals) == 0:
            return math.nan
        return float(np.mean(self.residuals**2 > 4.0 * (self.thickness**2 + _LEAST_THICKNESS**2)))

    def reversed(self, pose: Pose) -> "LocalPlanes":
        """Return it as if the probes had been the surface and the surface the probes.

        Carried by a pose into the other's frame. What moves the probes along a normal then widens
        the gap, whichever scan the probes come from.
        """
        turn = pose.rotation
        return LocalPlanes(
            self.has_plane,
            pose.apply(self.points),
            self.normals @ turn.T,
            -self.residuals,
            turn @ self.normal_covariances @ turn.T,
            self.flatness,
            self.thickness,
        )


@dataclass(frozen=True, kw_only=True, slots=True)
class LocalPlaneFitter:
    """Settings: which points of a scan are probes, and how the surface near them is found."""

    voxel_size: float = 1.0
    """At most one probe in each cube of this side [m], so that near walls do not decide alone."""

    max_points: int = 300
    """How many probes a scan gets at most, evenly over its cubes."""

    sample_size: int = 10000
    """How many points of the scan the probes are chosen from, evenly over its rows."""

    radii: tuple[float, ...] = (0.5, 1.0, 2.0)
    """A plane is fitted to the points this near to a probe [m]: within the first of these in which
    there are enough, so that near walls are seen sharply and far ground is seen at all."""

    min_points: int = 8
    """To so many points at least: of fewer, some make planes across corners."""

    min_breadth: float = 0.1
    """And not to a line: the variance along the narrower side of the points is at least this share
    of that along the wider one."""

    def __post_init__(self) -> None:
        require_positive("voxel_size", self.voxel_size, unit="m")
        if not self.radii:
            raise InvalidInput("radii must not be empty")
        for radius in self.radii:
            require_positive("radii", radius, unit="m")
        require_count("max_points", self.max_points)
        require_count("sample_size", self.sample_size)
        require_count("min_points", self.min_points, minimum=4)
        require_fraction("min_breadth", self.min_breadth)

    def query_points(self, cloud: PointCloud) -> Points:
        """Return (m, 3) points of a cloud, spread evenly over what it shows."""
        rows = np.flatnonzero(cloud.is_measured)
        points = cloud.points[_evenly(rows, self.sample_size)]
        if len(points) == 0:
            return read_only(points)
        labels, count = voxel_labels(points, self.voxel_size)
        firsts = np.empty(count, np.int64)
        firsts[labels[::-1]] = np.arange(len(labels))[::-1]
        return read_only(points[_evenly(firsts, self.max_points)])

    def cell_list(self, cloud: PointCloud) -> CellList:
        """Return what of a cloud can be probed."""
        return CellList.of_points(cloud.points, 2.0 * min(self.radii))

    def fit(self, points: CellList, query_points: Points) -> LocalPlanes:
        """Return the surface of some points near (m, 3) probes [m] in their frame.

        What is met in a wider circle comes after what is met in a narrower one.
        """
        left = np.arange(len(query_points))
        rows, fits = [], []
        for radius in self.radii:
            fit, is_plane = self._fitted(points.sums_near(query_points[left], radius))
            rows.append(left[is_plane])
            fits.append(fit[is_plane])
            left = left[~is_plane]
        has_plane = np.ones(len(query_points), np.bool_)
        has_plane[left] = False
        return _surface(query_points[np.concatenate(rows)], np.concatenate(fits), has_plane)

    def _fitted(self, sums: Matrix) -> tuple[Matrix, Mask]:
        """Return what `_surface` makes planes of, and which of them are planes.

        By (m, 10) sums about the probes: (m, 16) counts, means, variances, which ascend, and axes.
        """
        counts = np.maximum(sums[:, :1], 1.0)
        means = sums[:, 1:4] / counts
        packed = sums[:, 4:] / counts - means[:, _PACKED_ROWS] * means[:, _PACKED_COLUMNS]
        variances, axes = principal_axes(read_only(packed))
        is_broad = variances[:, 1] > np.maximum(self.min_breadth * variances[:, 2], _LEAST_VARIANCE)
        fits = np.hstack([counts, means, np.maximum(variances, 0.0), axes])
        return fits, is_broad & (sums[:, 0] >= self.min_points)


def joined(surfaces: Sequence[LocalPlanes]) -> LocalPlanes:
    """Return what was met in some surfaces one after the other."""
    return LocalPlanes(
        np.concatenate([one.has_plane for one in surfaces]),
        np.concatenate([one.points for one in surfaces]),
        np.concatenate([one.normals for one in surfaces]),
        np.concatenate([one.residuals for one in surfaces]),
        np.concatenate([one.normal_covariances for one in surfaces]),
        np.concatenate([one.flatness for one in surfaces]),
        np.concatenate([one.thickness for one in surfaces]),
    )


_PACKED_ROWS, _PACKED_COLUMNS = np.triu_indices(3)
"""Of the entries of an upper triangle."""

_LEAST_THICKNESS = 0.02
"""Of a surface [m]: the noise of a lidar, where a few points lie closer by chance."""

_LEAST_VARIANCE = 1e-9
"""Points whose narrower side has less [m^2] lie in one place, and on no plane of their own."""


def _surface(points: Points, fits: Matrix, has_plane: Mask) -> LocalPlanes:
    """Return the surface whose (k, 16) planes were fitted at (k, 3) places."""
    counts, means, variances = fits[:, 0], fits[:, 1:4], fits[:, 4:7]
    axes = fits[:, 7:].reshape(-1, 3, 3)
    normals = np.ascontiguousarray(axes[:, 0])
    return LocalPlanes(
        has_plane,
        points,
        normals,
        -(means * normals).sum(axis=1),
        _doubts(variances, axes, counts),
        1.0 - variances[:, 0] / variances[:, 1],
        _thickness(variances[:, 0], counts),
    )


def _doubts(variances: Matrix, axes: NDArray[np.float64], counts: Vector) -> NDArray[np.float64]:
    """Return (k, 3, 3) the covariances of the normals of planes fitted by least squares.

    A normal tips along an axis of its plane as far as noise across lifts the ends of the points.
    """
    tips = (variances[:, 0] / counts)[:, None] / variances[:, 1:]
    along = axes[:, 1:]
    return (along * tips[:, :, None]).transpose(0, 2, 1) @ along


def _thickness(variances: Vector, counts: Vector) -> Vector:
    """Return (k,) the deviation of one more point, given that of what fixed a plane's three."""
    return np.sqrt(variances * counts / (counts - 3.0) * (1.0 + 1.0 / counts))


def _evenly(rows: Labels, most: int) -> Labels:
    """Return at most so many of the rows, evenly spaced."""
    if len(rows) <= most:
        return rows
    return rows[np.linspace(0, len(rows) - 1, most).astype(np.int64)]
