"""Base plane: a coarse ground model that requires no sensor height."""

import math
from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Points, Vector, frozen, read_only
from scanlock.kernels.ground.plane import best_sampled_plane, refined_plane, weighted_columns

_TRIPLES = 1000
"""Number of candidate planes (ours).

If a fifth of the low points are ground, eight candidates are fits to ground points only.
"""

_SCORED = 700
"""Number of low points that score each candidate (ours)."""

THRESHOLD_FACTORS = read_only(np.array([2.0, 1.5, 1.0, 1.0]))
"""Factors of the inlier threshold in the reweighted fits that refine the best plane (ours)."""

THRESHOLD, THRESHOLD_SLOPE = 0.2, 0.02
"""Inlier threshold [m] and its increase per metre of range (ours).

Natural ground deviates from its tangent plane with distance.
"""

WEIGHT_RANGE = 10.0
"""Range r_0 [m] of the weights ``1 / (r + r_0)`` of low points at range r (ours).

The ground near the sensor matters most.
"""


@dataclass(frozen=True, slots=True, eq=False)
class BasePlane:
    """Plane ``normal . p + offset = 0`` through low points.

    Attributes
    ----------
    coefficients : (4,)
        Coefficients of the height ``a x + b y + c z + d``: the upward unit normal and `offset`.
    support : float
        Weighted fraction of the low points on the plane, less half of that below it.
    """

    coefficients: Vector
    support: float

    def __post_init__(self) -> None:
        frozen(self.coefficients)

    @property
    def normal(self) -> Vector:
        """(3,) unit normal, upwards."""
        return self.coefficients[:3]

    @property
    def offset(self) -> float:
        """Height of the origin above the plane [m]."""
        return float(self.coefficients[3])

    @property
    def tilt(self) -> float:
        """Angle between the normal and the z axis [rad]."""
        x, y, z = self.normal
        return math.atan2(math.hypot(x, y), z)

    def heights(self, points: Points) -> Vector:
        """Return the (n,) heights [m] of points above the plane."""
        return points @ self.normal + self.offset


def fit_base_plane(low_points: Points, *, max_tilt: float) -> BasePlane | None:
    """Fit the base plane to low points; deterministic.

    The score of a plane increases with low points near it and decreases with low points clearly
    below it. A floor thus scores higher than a table or a ceiling, and a bridge under the sensor
    can score higher than the valley.

    Parameters
    ----------
    low_points : (n, 3) [m]
        Lowest points of cells.
    max_tilt : float [rad]
        Largest angle between the normal and the z axis.

    Returns
    -------
    BasePlane or None
        None for fewer than three points, or without a plane of positive score.
    """
    n = len(low_points)
    if n < 3:
        return None
    columns = weighted_columns(read_only(low_points), WEIGHT_RANGE, THRESHOLD, THRESHOLD_SLOPE)
    sample = np.ascontiguousarray(columns[:, :: max(1, n // _SCORED)])
    frozen(columns)
    frozen(sample)
    x, y, z, weights, sharpness = sample
    nx, ny, nz, d, score = best_sampled_plane(
        x, y, z, weights, sharpness, _TRIPLES, math.cos(max_tilt)
    )
    if score <= 0.0:
        return None
    x, y, z, weights, sharpness = columns
    nx, ny, nz, d, score = refined_plane(
        x, y, z, weights, sharpness, THRESHOLD_FACTORS, nx, ny, nz, d
    )
    if score == -math.inf:
        return None
    return BasePlane(np.array([nx, ny, nz, d]), max(score, 0.0))
