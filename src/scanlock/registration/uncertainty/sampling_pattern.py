"""Sampling pattern of a scan: the angles between its samples, and the pose error that they cause.

Scores and nearest neighbours pull the samples of the source onto those of the target, along the
surfaces too. Where the patterns differ, as between the rings of two scans, the pose follows the
pattern by up to a gap between samples. All blocks of the scene then agree at a wrong pose, so that
the scatter of their gradients does not show it.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Matrix, Points, read_only
from scanlock.geometry.pose import Pose
from scanlock.kernels.gaussians.eigen3 import principal_axes

_BAND_QUANTILES = (0.25, 0.75)
"""Quantiles of the slopes of points at which gaps of azimuth are measured."""

_HALF_WIDTH = math.radians(0.4)
"""Half the width of a sector or band [rad]: one or two rings, and some points of each."""

_MAX_GAP = math.radians(8.0)
"""Maximum angle between neighbouring samples [rad]; wider gaps have no surface."""

_PACKED_ROWS, _PACKED_COLUMNS = np.triu_indices(3)

_Angles = NDArray[np.float32]
"""Coordinates, slopes or angles in single precision."""


@dataclass(frozen=True, kw_only=True, slots=True)
class SamplingPattern:
    """Angles between the samples of a scan about its sensor."""

    elevation_gap: float
    """Typical gap between elevations at one azimuth, as between rings [rad]."""

    azimuth_gap: float
    """Typical gap between azimuths at one elevation, as between points of a ring [rad]."""

    @classmethod
    def of_points(cls, points: Points) -> "SamplingPattern":
        """Measure the pattern of (n, 3) points about the sensor at the origin [m].

        Half of the angle of view lies in gaps of at least the typical one.
        """
        # Single precision is exact to a thousandth of a gap, and halves the time.
        x, y, z = points.T.astype(np.float32, order="C")
        return cls(
            elevation_gap=_weighted_median(_elevation_gaps(x, y, z)),
            azimuth_gap=_weighted_median(_azimuth_gaps(x, y, z)),
        )

    def covariance(self, pose: Pose) -> Matrix:
        """Return the (6, 6) covariance of a step by which the pattern is displaced.

        The phase between the patterns of two scans is unknown: uniform over a gap, with a twelfth
        of its square as variance. The pattern turns about the sensor: by the gap of elevation
        about the horizontal axes, by that of azimuth about z.
        """
        gaps = np.array([self.elevation_gap, self.elevation_gap, self.azimuth_gap])
        variances = gaps**2 / 12.0
        covariance = np.zeros((6, 6))
        covariance[3:, 3:] = pose.rotation * variances @ pose.rotation.T
        # From a step about the source's origin to one about the target's.
        adjoint = Pose(np.eye(3), pose.translation).adjoint()
        return adjoint @ covariance @ adjoint.T


def hessian_along_surfaces(hessians: Matrix, positions: Points) -> Matrix:
    """Return the (6, 6) sum of the Hessians of k cells without those along their normals.

    The normal of a cell is the translation with the largest curvature. Along it the surface itself
    constrains the pose, and across it the pattern of samples and the edges of surfaces do.

    Parameters
    ----------
    hessians : (k, 6, 6)
        Contributions of the cells, for a step ``(rho, phi)`` about the target's origin.
    positions : (k, 3) [m]
        Positions of the cells in the target's frame.
    """
    packed = np.ascontiguousarray(hessians[:, _PACKED_ROWS, _PACKED_COLUMNS])
    curvatures, axes = principal_axes(read_only(packed))
    scales = np.sqrt(np.maximum(curvatures[:, :2], 0.0))
    motions = axes.reshape(-1, 3, 3)[:, :2] * scales[:, :, None]
    turns = np.cross(positions[:, None, :], motions)
    rows = np.concatenate([motions, turns], axis=2).reshape(-1, 6)
    return rows.T @ rows


def _elevation_gaps(x: _Angles, y: _Angles, z: _Angles) -> _Angles:
    """Return the gaps between elevations in four sectors about the axes x and y."""
    gaps: list[_Angles] = []
    for along, across in ((x, y), (y, x)):
        rows = np.flatnonzero(np.abs(across) < np.float32(math.tan(_HALF_WIDTH)) * np.abs(along))
        distances = along[rows]
        for side in (distances > 0.0, distances < 0.0):
            gaps.append(_gaps(np.arctan(z[rows[side]] / np.abs(distances[side]))))
    return np.concatenate(gaps)


def _azimuth_gaps(x: _Angles, y: _Angles, z: _Angles) -> _Angles:
    """Return the gaps between azimuths in two bands of elevation."""
    slopes = z / np.sqrt(np.maximum(x * x + y * y, np.float32(1e-12)))
    gaps: list[_Angles] = []
    sample = slopes[:: max(1, len(slopes) // 1000)]
    # Slopes of points: a band between two rings would be empty.
    for slope in np.quantile(sample, _BAND_QUANTILES, method="nearest"):
        # A difference of slopes is that of the elevations divided by the squared cosine.
        rows = np.flatnonzero(
            np.abs(slopes - slope) < np.float32(_HALF_WIDTH) * (1 + slope * slope)
        )
        gaps.append(_gaps(np.arctan2(y[rows], x[rows])))
    return np.concatenate(gaps)


def _gaps(angles: _Angles) -> _Angles:
    """Return the gaps between neighbouring angles, without those that have no surface."""
    gaps = np.diff(np.sort(angles))
    return gaps[gaps < _MAX_GAP]


def _weighted_median(gaps: _Angles) -> float:
    """Return the gap such that half of the total lies in gaps of at least that; 0 without any."""
    if len(gaps) == 0:
        return 0.0
    ordered = np.sort(gaps)
    totals = np.cumsum(ordered, dtype=np.float64)
    return float(ordered[np.searchsorted(totals, 0.5 * totals[-1])])
