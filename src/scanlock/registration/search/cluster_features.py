"""Features of clusters for matching: extents, axes and heights.

The number of points is left out, since it depends on the range.
"""

import enum
from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector, frozen, read_only
from scanlock.geometry.pose import Pose
from scanlock.kernels.gaussians.eigen3 import principal_axes
from scanlock.models.gaussians import Gaussians

_MIN_ANISOTROPY = 2.5
"""Minimum ratio of successive principal deviations of a thin or flat cluster."""

_MIN_HEADING_RATIO = 0.7
"""Minimum difference of the two horizontal principal variances, relative to their sum, of a
cluster with a heading. Its longer deviation is then 2.4 times the shorter."""

_MIN_HEADING_DEVIATION = 0.6
"""Minimum horizontal deviation [m] of a cluster with a heading; below it the heading is noise."""

_TOP_DEVIATIONS = 1.7
"""Deviations from the mean of a uniform distribution to its end: the square root of three."""

_MIN_VARIANCE = 1e-6
"""Minimum variance in logarithms [m^2]."""


class ClusterKind(enum.IntEnum):
    """Class of a cluster by its extents; only clusters of one kind are matched."""

    ROUND = 0
    THIN = 1
    """One long axis: poles, trunks, rails."""
    FLAT = 2
    """One short axis: walls, sides of vehicles."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class ClusterFeatures:
    """Features of k clusters, in the levelled frame of their scan, or else in the scan's frame.

    Attributes
    ----------
    centres : (k, 3) [m]
        Means of the clusters.
    covariances : (k, 6) [m^2]
        Upper triangles of the covariances: xx, xy, xz, yy, yz, zz.
    kinds : (k,)
        `ClusterKind` of each cluster.
    log_deviations : (k, 3)
        Logarithms of the principal standard deviations [m], ascending; invariant to rotations.
    vertical_features : (k, 4)
        Logarithm of the vertical deviation [m], cosine between axis and vertical, height of the
        centre [m] and of the top [m]. Meaningful in a levelled frame only.
    axes : (k, 3)
        Unit normals of flat clusters, directions of thin ones, zeros for round ones; the sign is
        arbitrary.
    headings : (k, 2)
        Cosine and sine of twice the heading of the longer horizontal axis; zeros without one.
    level_from_scan : Pose or None
        Pose of the scan in its levelled frame; None if no ground was found.
    """

    centres: Points
    covariances: Matrix
    kinds: Labels
    log_deviations: Matrix
    vertical_features: Matrix
    axes: Points
    headings: Matrix
    level_from_scan: Pose | None

    def __post_init__(self) -> None:
        for array in (
            self.centres, self.covariances, self.kinds, self.log_deviations,
            self.vertical_features, self.axes, self.headings,
        ):  # fmt: skip
            frozen(array)

    def __len__(self) -> int:
        return len(self.centres)

    @classmethod
    def from_gaussians(
        cls, gaussians: Gaussians, level_from_scan: Pose | None = None
    ) -> "ClusterFeatures":
        """Compute the features of the clusters of a scan, row by row."""
        level = gaussians if level_from_scan is None else gaussians.transformed(level_from_scan)
        variances, axes = principal_axes(read_only(level.packed_covariances))
        deviations = np.sqrt(np.maximum(variances, _MIN_VARIANCE))
        kinds = _kinds(deviations)
        axis = np.where((kinds == ClusterKind.FLAT)[:, None], axes[:, :3], axes[:, 6:])
        return cls(
            centres=level.means,
            covariances=level.packed_covariances,
            kinds=kinds,
            log_deviations=np.log(deviations),
            vertical_features=_vertical_features(level, axis),
            axes=np.where((kinds == ClusterKind.ROUND)[:, None], 0.0, axis),
            headings=_headings(level.packed_covariances),
            level_from_scan=level_from_scan,
        )


def _kinds(deviations: Matrix) -> Labels:
    is_thin = deviations[:, 2] > _MIN_ANISOTROPY * deviations[:, 1]
    is_flat = ~is_thin & (deviations[:, 1] > _MIN_ANISOTROPY * deviations[:, 0])
    return np.where(
        is_thin, ClusterKind.THIN, np.where(is_flat, ClusterKind.FLAT, ClusterKind.ROUND)
    ).astype(np.int64)


def _vertical_features(gaussians: Gaussians, axis: Points) -> Matrix:
    heights: Vector = gaussians.means[:, 2]
    deviations = np.sqrt(np.maximum(gaussians.packed_covariances[:, 5], _MIN_VARIANCE))
    tops = heights + _TOP_DEVIATIONS * deviations
    return np.stack([np.log(deviations), np.abs(axis[:, 2]), heights, tops], axis=1)


def _headings(covariances: Matrix) -> Matrix:
    xx, xy, yy = covariances[:, 0], covariances[:, 1], covariances[:, 3]
    doubled = np.stack([xx - yy, 2.0 * xy], axis=1)
    difference = np.hypot(*doubled.T)
    has_heading = (difference > _MIN_HEADING_RATIO * (xx + yy)) & (
        xx + yy > _MIN_HEADING_DEVIATION**2
    )
    return np.where(
        has_heading[:, None], doubled / np.where(has_heading, difference, 1.0)[:, None], 0.0
    )
