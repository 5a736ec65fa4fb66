"""What of a cluster can be recognised from another place: its extents, stance and axes.

The number of points is left out, since it follows the range.
"""

import enum
from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector, frozen, read_only
from scanlock.geometry.pose import Pose
from scanlock.kernels.gaussians.eigen3 import principal_axes
from scanlock.models.gaussians import Gaussians

_FLAT = 2.5
"""A deviation this many times the next smaller one makes a part thin or flat."""

_LONG = 0.7
"""Horizontal variances differ by at least this share of their sum where a part has a heading;
the longer deviation is then 2.4 times the shorter."""

_LEAST_SPREAD = 0.6
"""Horizontal deviation [m] below which the heading is mostly noise."""

_TOP = 1.7
"""Deviations from the middle of an even spread to its end: the root of three."""

_LEAST_VARIANCE = 1e-6
"""Keeps the logarithm of flat parts finite [m^2]."""


class ClusterKind(enum.IntEnum):
    """What a part's extents make of it; only parts of one kind are matched."""

    ROUND = 0
    THIN = 1
    """Poles, trunks, rails: one long axis."""
    FLAT = 2
    """Walls and sides: one short axis."""


@dataclass(frozen=True, slots=True, eq=False)
class ClusterFeatures:
    """What k clusters look like, in the level frame if there is one, else in that of the scan.

    Attributes
    ----------
    centres : (k, 3) [m]
    spreads : (k, 6) [m^2]
        Upper triangles of the covariances: xx, xy, xz, yy, yz, zz.
    kinds : (k,)
        `ClusterKind` of each.
    shapes : (k, 3)
        Logarithms of the deviations [m] along the principal axes, ascending; no rotation
        changes them.
    stances : (k, 4)
        Logarithm of the vertical deviation [m], cosine of the axis to the vertical, height of
        the centre [m] and of the top [m]; mean something only where there is a level frame.
    axes : (k, 3)
        Unit normal of flat parts, direction of thin ones, zeros for round ones; no sign.
    headings : (k, 2)
        Cosine and sine of twice the angle of the long axis seen from above; zeros without one.
    level_from_scan : Pose or None
        Turns the scan upright with the ground at z = 0; None where no ground was found.
    """

    centres: Points
    spreads: Matrix
    kinds: Labels
    shapes: Matrix
    stances: Matrix
    axes: Points
    headings: Matrix
    level_from_scan: Pose | None

    def __post_init__(self) -> None:
        for array in (
            self.centres, self.spreads, self.kinds, self.shapes, self.stances, self.axes,
            self.headings,
        ):  # fmt: skip
            frozen(array)

    def __len__(self) -> int:
        return len(self.centres)

    @classmethod
    def of(cls, gaussians: Gaussians, level_from_scan: Pose | None = None) -> "ClusterFeatures":
        """Return the features of the clusters of a scan, row by row."""
        moved = gaussians if level_from_scan is None else gaussians.transformed(level_from_scan)
        variances, axes = principal_axes(read_only(moved.packed_covariances))
        deviations = np.sqrt(np.maximum(variances, _LEAST_VARIANCE))
        kinds = _kinds(deviations)
        axis = np.where((kinds == ClusterKind.FLAT)[:, None], axes[:, :3], axes[:, 6:])
        return cls(
            moved.means,
            moved.packed_covariances,
            kinds,
            np.log(deviations),
            _stances(moved, axis),
            np.where((kinds == ClusterKind.ROUND)[:, None], 0.0, axis),
            _headings(moved.packed_covariances),
            level_from_scan,
        )


def _kinds(deviations: Matrix) -> Labels:
    thin = deviations[:, 2] > _FLAT * deviations[:, 1]
    flat = ~thin & (deviations[:, 1] > _FLAT * deviations[:, 0])
    return np.where(
        thin, ClusterKind.THIN, np.where(flat, ClusterKind.FLAT, ClusterKind.ROUND)
    ).astype(np.int64)


def _stances(gaussians: Gaussians, axis: Points) -> Matrix:
    heights: Vector = gaussians.means[:, 2]
    deviations = np.sqrt(np.maximum(gaussians.packed_covariances[:, 5], _LEAST_VARIANCE))
    tops = heights + _TOP * deviations
    return np.stack([np.log(deviations), np.abs(axis[:, 2]), heights, tops], axis=1)


def _headings(spreads: Matrix) -> Matrix:
    xx, xy, yy = spreads[:, 0], spreads[:, 1], spreads[:, 3]
    doubled = np.stack([xx - yy, 2.0 * xy], axis=1)
    length = np.hypot(*doubled.T)
    has_heading = (length > _LONG * (xx + yy)) & (xx + yy > _LEAST_SPREAD**2)
    return np.where(
        has_heading[:, None], doubled / np.where(has_heading, length, 1.0)[:, None], 0.0
    )
