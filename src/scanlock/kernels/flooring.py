"""Variances of Gaussians raised to a floor along their own axes.

Jacobi's method in a fixed number of rounds without a branch, so that vector units turn several
matrices at once: a tenth of the time of turning them one by one until each is clear.
"""

import math

import numpy as np

from scanlock.arrays import Matrix
from scanlock.kernels._compile import sum_kernel, sum_part

_TINY = 1e-300
"""Makes the turn of an entry that is zero already zero, not 0 / 0."""


@sum_part
def _rotation(
    app: float, aqq: float, apq: float, arp: float, arq: float
) -> tuple[float, float, float, float, float, float]:
    """Return entries pp, qq, rp, rq once pq is turned to zero, and the cosine and sine."""
    gap = aqq - app
    twice = 2.0 * apq
    # The smaller of the two turns that would do.
    t = math.copysign(1.0, gap) * twice / (abs(gap) + math.sqrt(gap * gap + twice * twice) + _TINY)
    c = 1.0 / math.sqrt(1.0 + t * t)
    s = t * c
    return app - t * apq, aqq + t * apq, c * arp - s * arq, s * arp + c * arq, c, s


@sum_part
def _round(
    xx: float, xy: float, xz: float, yy: float, yz: float, zz: float,
    a0: float, a1: float, a2: float,
    b0: float, b1: float, b2: float,
    c0: float, c1: float, c2: float,
) -> tuple[
    float, float, float, float, float, float,
    float, float, float, float, float, float, float, float, float,
]:  # fmt: skip
    """Return a symmetric matrix and its axes a, b, c after one turn about each axis."""
    xx, yy, xz, yz, c, s = _rotation(xx, yy, xy, xz, yz)
    a0, b0 = c * a0 - s * b0, s * a0 + c * b0
    a1, b1 = c * a1 - s * b1, s * a1 + c * b1
    a2, b2 = c * a2 - s * b2, s * a2 + c * b2
    xx, zz, xy, yz, c, s = _rotation(xx, zz, xz, 0.0, yz)
    a0, c0 = c * a0 - s * c0, s * a0 + c * c0
    a1, c1 = c * a1 - s * c1, s * a1 + c * c1
    a2, c2 = c * a2 - s * c2, s * a2 + c * c2
    yy, zz, xy, xz, c, s = _rotation(yy, zz, yz, xy, 0.0)
    b0, c0 = c * b0 - s * c0, s * b0 + c * c0
    b1, c1 = c * b1 - s * c1, s * b1 + c * c1
    b2, c2 = c * b2 - s * c2, s * b2 + c * c2
    return xx, xy, xz, yy, 0.0, zz, a0, a1, a2, b0, b1, b2, c0, c1, c2


@sum_kernel
def floored_covariances(packed: Matrix, least: float, ratio: float) -> tuple[Matrix, Matrix]:
    """Return covariances with no principal variance below a floor, and those variances.

    Covariances are (k, 6) packed upper triangles; the floor is the larger of `least` and `ratio`
    times the largest variance of the same matrix. The (k, 3) variances ascend.
    """
    count = packed.shape[0]
    # Entry by entry: what is read and written in a row goes through vector units.
    entries = np.ascontiguousarray(packed.T)
    raised = np.empty((6, count), np.float64)
    variances = np.empty((3, count), np.float64)
    for k in range(count):
        xx, xy, xz = entries[0, k], entries[1, k], entries[2, k]
        yy, yz, zz = entries[3, k], entries[4, k], entries[5, k]
        a0, a1, a2 = 1.0, 0.0, 0.0
        b0, b1, b2 = 0.0, 1.0, 0.0
        c0, c1, c2 = 0.0, 0.0, 1.0
        # Five rounds clear any matrix to the last digit. Not a loop: that would leave the outer
        # one to a single lane.
        xx, xy, xz, yy, yz, zz, a0, a1, a2, b0, b1, b2, c0, c1, c2 = _round(
            xx, xy, xz, yy, yz, zz, a0, a1, a2, b0, b1, b2, c0, c1, c2
        )
        xx, xy, xz, yy, yz, zz, a0, a1, a2, b0, b1, b2, c0, c1, c2 = _round(
            xx, xy, xz, yy, yz, zz, a0, a1, a2, b0, b1, b2, c0, c1, c2
        )
        xx, xy, xz, yy, yz, zz, a0, a1, a2, b0, b1, b2, c0, c1, c2 = _round(
            xx, xy, xz, yy, yz, zz, a0, a1, a2, b0, b1, b2, c0, c1, c2
        )
        xx, xy, xz, yy, yz, zz, a0, a1, a2, b0, b1, b2, c0, c1, c2 = _round(
            xx, xy, xz, yy, yz, zz, a0, a1, a2, b0, b1, b2, c0, c1, c2
        )
        xx, xy, xz, yy, yz, zz, a0, a1, a2, b0, b1, b2, c0, c1, c2 = _round(
            xx, xy, xz, yy, yz, zz, a0, a1, a2, b0, b1, b2, c0, c1, c2
        )
        floor = max(least, ratio * max(xx, max(yy, zz)))
        u, v, w = max(xx, floor), max(yy, floor), max(zz, floor)
        raised[0, k] = u * a0 * a0 + v * b0 * b0 + w * c0 * c0
        raised[1, k] = u * a0 * a1 + v * b0 * b1 + w * c0 * c1
        raised[2, k] = u * a0 * a2 + v * b0 * b2 + w * c0 * c2
        raised[3, k] = u * a1 * a1 + v * b1 * b1 + w * c1 * c1
        raised[4, k] = u * a1 * a2 + v * b1 * b2 + w * c1 * c2
        raised[5, k] = u * a2 * a2 + v * b2 * b2 + w * c2 * c2
        variances[0, k] = min(u, min(v, w))
        variances[1, k] = max(min(u, v), min(max(u, v), w))
        variances[2, k] = max(u, max(v, w))
    return np.ascontiguousarray(raised.T), np.ascontiguousarray(variances.T)
