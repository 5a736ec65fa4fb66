"""Shape of the surface around each point: scatter of its neighbours and the principal axes."""

import math

import numpy as np

from scanlock.arrays import Labels, Matrix, Points
from scanlock.kernels._compile import kernel

_MOST_SWEEPS = 12
"""Jacobi sweeps on a 3x3 matrix converge quadratically: four to six do, whatever the matrix."""


@kernel
def neighbour_covariances(points: Points, neighbours: Labels) -> Matrix:
    """Return the (n, 6) covariances of the points in each row of `neighbours` (n, k).

    Packed as xx, xy, xz, yy, yz, zz and divided by k. Coordinates are taken about the row's
    first neighbour, so that surfaces far from zero lose no digits.
    """
    n, k = neighbours.shape
    covariances = np.empty((n, 6))
    for i in range(n):
        o = neighbours[i, 0]
        o0, o1, o2 = points[o, 0], points[o, 1], points[o, 2]
        x = y = z = 0.0
        xx = xy = xz = yy = yz = zz = 0.0
        for j in range(1, k):
            p = neighbours[i, j]
            d0, d1, d2 = points[p, 0] - o0, points[p, 1] - o1, points[p, 2] - o2
            x += d0
            y += d1
            z += d2
            xx += d0 * d0
            xy += d0 * d1
            xz += d0 * d2
            yy += d1 * d1
            yz += d1 * d2
            zz += d2 * d2
        x /= k
        y /= k
        z /= k
        covariances[i, 0] = xx / k - x * x
        covariances[i, 1] = xy / k - x * y
        covariances[i, 2] = xz / k - x * z
        covariances[i, 3] = yy / k - y * y
        covariances[i, 4] = yz / k - y * z
        covariances[i, 5] = zz / k - z * z
    return covariances


@kernel
def _turn(app: float, aqq: float, apq: float) -> tuple[float, float, float]:
    """Return cosine, sine and tangent of the Jacobi rotation that clears `apq`."""
    if apq == 0.0:
        return 1.0, 0.0, 0.0
    theta = 0.5 * (aqq - app) / apq
    t = 1.0 / (abs(theta) + math.sqrt(theta * theta + 1.0))
    if theta < 0.0:
        t = -t
    c = 1.0 / math.sqrt(t * t + 1.0)
    return c, t * c, t


@kernel
def principal_axes(covariances: Matrix) -> tuple[Matrix, Matrix]:
    """Return the (n, 3) variances, ascending, and their (n, 9) axes, one after the other.

    Cyclic Jacobi rotations: unlike closed formulas they keep the axes orthonormal to rounding
    where variances are equal or zero. Each axis is a unit vector of either sign.
    """
    n = covariances.shape[0]
    variances = np.empty((n, 3))
    axes = np.empty((n, 9))
    values = np.empty(3)
    vectors = np.empty((3, 3))
    for i in range(n):
        a00, a01, a02 = covariances[i, 0], covariances[i, 1], covariances[i, 2]
        a11, a12, a22 = covariances[i, 3], covariances[i, 4], covariances[i, 5]
        u0, u1, u2 = 1.0, 0.0, 0.0
        v0, v1, v2 = 0.0, 1.0, 0.0
        w0, w1, w2 = 0.0, 0.0, 1.0
        for _ in range(_MOST_SWEEPS):
            # Below the rounding of the diagonal an entry turns nothing any more.
            off = abs(a01) + abs(a02) + abs(a12)
            if off <= 1e-17 * (abs(a00) + abs(a11) + abs(a22)):
                break
            c, s, t = _turn(a00, a11, a01)
            a00, a11, a01 = a00 - t * a01, a11 + t * a01, 0.0
            a02, a12 = c * a02 - s * a12, s * a02 + c * a12
            u0, v0 = c * u0 - s * v0, s * u0 + c * v0
            u1, v1 = c * u1 - s * v1, s * u1 + c * v1
            u2, v2 = c * u2 - s * v2, s * u2 + c * v2
            c, s, t = _turn(a00, a22, a02)
            a00, a22, a02 = a00 - t * a02, a22 + t * a02, 0.0
            a01, a12 = c * a01 - s * a12, s * a01 + c * a12
            u0, w0 = c * u0 - s * w0, s * u0 + c * w0
            u1, w1 = c * u1 - s * w1, s * u1 + c * w1
            u2, w2 = c * u2 - s * w2, s * u2 + c * w2
            c, s, t = _turn(a11, a22, a12)
            a11, a22, a12 = a11 - t * a12, a22 + t * a12, 0.0
            a01, a02 = c * a01 - s * a02, s * a01 + c * a02
            v0, w0 = c * v0 - s * w0, s * v0 + c * w0
            v1, w1 = c * v1 - s * w1, s * v1 + c * w1
            v2, w2 = c * v2 - s * w2, s * v2 + c * w2
        values[0], values[1], values[2] = a00, a11, a22
        vectors[0, 0], vectors[0, 1], vectors[0, 2] = u0, u1, u2
        vectors[1, 0], vectors[1, 1], vectors[1, 2] = v0, v1, v2
        vectors[2, 0], vectors[2, 1], vectors[2, 2] = w0, w1, w2
        low = 0 if a00 <= a11 and a00 <= a22 else (1 if a11 <= a22 else 2)
        high = 2 if a22 >= a00 and a22 >= a11 else (1 if a11 >= a00 else 0)
        order = (low, 3 - low - high, high)
        for m in range(3):
            variances[i, m] = values[order[m]]
            for d in range(3):
                axes[i, 3 * m + d] = vectors[order[m], d]
    return variances, axes
