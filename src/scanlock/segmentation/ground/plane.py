"""The base plane: a coarse ground that needs no guess of the sensor's height."""

import math
from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Points, Vector, frozen, read_only
from scanlock.kernels.ground.plane import best_triple_plane, plane_columns, refined_plane

_TRIPLES = 1000
"""Planes tried (ours); with a fifth of the low points on the ground, eight of them lie on it."""

_SCORED = 700
"""Low points that score each of those planes (ours)."""

_REACHES = read_only(np.array([2.0, 1.5, 1.0, 1.0]))
"""Gates, narrowing, of the reweighted fits that refine the best plane (ours)."""

_GATE, _GATE_SLOPE = 0.2, 0.02
"""A low point is near a plane within ``_GATE`` [m] plus ``_GATE_SLOPE`` times its range (ours):
natural ground leaves its tangent plane with distance."""

_NEAR = 10.0
"""A low point weighs in inverse proportion to its range plus this [m] (ours): the ground that
matters is the one under the sensor."""


@dataclass(frozen=True, slots=True, eq=False)
class BasePlane:
    """The plane ``normal . p + offset = 0`` that low points share.

    Attributes
    ----------
    coefficients : (4,)
        Height above the plane as ``a x + b y + c z + d``: the unit normal, upwards, and `offset`.
    support : float
        Weighted share of the low points on the plane, less half that of those beneath it.
    """

    coefficients: Vector
    support: float

    def __post_init__(self) -> None:
        frozen(self.coefficients)

    @property
    def normal(self) -> Vector:
        """(3,): unit vector, upwards."""
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
    """Return the plane that serves best as the ground of (n, 3) low points; None without one.

    A plane gains by each low point near it and loses by each one clearly beneath it, so a
    table or a ceiling loses to the floor, and a bridge under the sensor may still win over the
    valley. Planes tilted beyond `max_tilt` [rad] are not tried. Deterministic.
    """
    n = len(low_points)
    if n < 3:
        return None
    columns = plane_columns(read_only(low_points), _NEAR, _GATE, _GATE_SLOPE)
    sample = np.ascontiguousarray(columns[:, :: max(1, n // _SCORED)])
    frozen(columns)
    frozen(sample)
    x, y, z, weights, sharpness = sample
    nx, ny, nz, d, score = best_triple_plane(
        x, y, z, weights, sharpness, _TRIPLES, math.cos(max_tilt)
    )
    if score <= 0.0:
        return None
    x, y, z, weights, sharpness = columns
    nx, ny, nz, d, score = refined_plane(x, y, z, weights, sharpness, _REACHES, nx, ny, nz, d)
    if score == -math.inf:
        return None
    return BasePlane(np.array([nx, ny, nz, d]), max(score, 0.0))
