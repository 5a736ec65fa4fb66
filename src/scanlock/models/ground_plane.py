"""The base plane: a coarse ground that needs no guess of the sensor's height."""

from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Points, Vector, frozen
from scanlock.kernels.ground_plane import best_triple_plane, plane_moments, plane_score

_TRIPLES = 1000
"""Planes tried (ours); with a fifth of the low points on the ground, eight of them lie on it."""

_SCORED = 700
"""Low points that score each of those planes (ours)."""

_REACHES = (2.0, 1.5, 1.0, 1.0)
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
    normal : (3,)
        Unit vector, upwards.
    offset : float [m]
        Height of the origin above the plane.
    support : float
        Weighted share of the low points on the plane, less half that of those beneath it.
    """

    normal: Vector
    offset: float
    support: float

    def __post_init__(self) -> None:
        frozen(self.normal)

    @property
    def coefficients(self) -> Vector:
        """(4,): height above the plane as ``a x + b y + c z + d``."""
        coefficients = np.append(self.normal, self.offset)
        frozen(coefficients)
        return coefficients

    @property
    def tilt(self) -> float:
        """Angle between the normal and the z axis [rad]."""
        return float(np.arctan2(np.hypot(self.normal[0], self.normal[1]), self.normal[2]))

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
    ranges = np.hypot(low_points[:, 0], low_points[:, 1])
    nearness = 1.0 / (_NEAR + ranges)
    columns = np.stack(
        [*low_points.T, nearness / nearness.sum(), 1.0 / (_GATE + _GATE_SLOPE * ranges)]
    )
    sample = np.ascontiguousarray(columns[:, :: max(1, n // _SCORED)])
    frozen(columns)
    x, y, z, weights, sharpness = columns
    frozen(sample)
    nx, ny, nz, d, score = best_triple_plane(
        sample[0], sample[1], sample[2], sample[3], sample[4], _TRIPLES, float(np.cos(max_tilt))
    )
    if score <= 0.0:
        return None
    normal = np.array([nx, ny, nz])
    for reach in _REACHES:
        sums = plane_moments(x, y, z, weights, sharpness, reach, nx, ny, nz, d)
        if sums[0] <= 0.0:
            return None
        mean = sums[1:4] / sums[0]
        xx, xy, xz, yy, yz, zz = sums[4:] / sums[0]
        second = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        _, axes = np.linalg.eigh(second - np.outer(mean, mean))
        normal = axes[:, 0] if axes[2, 0] >= 0.0 else -axes[:, 0]
        nx, ny, nz = (float(part) for part in normal)
        d = -float(normal @ mean)
    score = plane_score(x, y, z, weights, sharpness, nx, ny, nz, d)
    return BasePlane(normal, d, max(score, 0.0))
