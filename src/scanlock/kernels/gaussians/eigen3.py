"""Principal axes of covariances, and variances raised to a floor along them.

Jacobi's method in a fixed number of rounds without a branch, so that vector units turn several
matrices at once: a tenth of the time of turning them one by one until each is clear.
"""

import math

import numpy as np

from scanlock.arrays import Matrix, Vector
from scanlock.kernels._compile import kernel, sum_kernel, sum_part

_BLOCK = 128
"""Matrices that are turned at a time; what they take stays in the nearest cache."""

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


@sum_part
def _ordered(
    x: float, x0: float, x1: float, x2: float, y: float, y0: float, y1: float, y2: float
) -> tuple[float, float, float, float, float, float, float, float]:
    """Return two variances with their axes, the smaller first."""
    swaps = x > y
    return (
        y if swaps else x, y0 if swaps else x0, y1 if swaps else x1, y2 if swaps else x2,
        x if swaps else y, x0 if swaps else y0, x1 if swaps else y1, x2 if swaps else y2,
    )  # fmt: skip


@sum_kernel
def _turn_block(entries: Vector, turned: Vector) -> None:
    """Write the ascending variances and the axes, 12 rows, of packed covariances, 6 rows.

    Rows of a fixed length in flat arrays: only then is it clear that no two of them overlap.
    """
    for k in range(_BLOCK):
        xx, xy, xz = entries[k], entries[_BLOCK + k], entries[2 * _BLOCK + k]
        yy, yz, zz = entries[3 * _BLOCK + k], entries[4 * _BLOCK + k], entries[5 * _BLOCK + k]
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
        xx, a0, a1, a2, yy, b0, b1, b2 = _ordered(xx, a0, a1, a2, yy, b0, b1, b2)
        xx, a0, a1, a2, zz, c0, c1, c2 = _ordered(xx, a0, a1, a2, zz, c0, c1, c2)
        yy, b0, b1, b2, zz, c0, c1, c2 = _ordered(yy, b0, b1, b2, zz, c0, c1, c2)
        turned[k], turned[_BLOCK + k], turned[2 * _BLOCK + k] = xx, yy, zz
        turned[3 * _BLOCK + k], turned[4 * _BLOCK + k], turned[5 * _BLOCK + k] = a0, a1, a2
        turned[6 * _BLOCK + k], turned[7 * _BLOCK + k], turned[8 * _BLOCK + k] = b0, b1, b2
        turned[9 * _BLOCK + k], turned[10 * _BLOCK + k], turned[11 * _BLOCK + k] = c0, c1, c2


@sum_kernel
def _raise_block(turned: Vector, least: float, ratio: float, raised: Vector) -> None:
    """Raise the variances of a block in place, and write the packed covariances, 6 rows."""
    for k in range(_BLOCK):
        floor = max(least, ratio * turned[2 * _BLOCK + k])
        u = max(turned[k], floor)
        v = max(turned[_BLOCK + k], floor)
        w = max(turned[2 * _BLOCK + k], floor)
        a0, a1, a2 = turned[3 * _BLOCK + k], turned[4 * _BLOCK + k], turned[5 * _BLOCK + k]
        b0, b1, b2 = turned[6 * _BLOCK + k], turned[7 * _BLOCK + k], turned[8 * _BLOCK + k]
        c0, c1, c2 = turned[9 * _BLOCK + k], turned[10 * _BLOCK + k], turned[11 * _BLOCK + k]
        turned[k], turned[_BLOCK + k], turned[2 * _BLOCK + k] = u, v, w
        raised[k] = u * a0 * a0 + v * b0 * b0 + w * c0 * c0
        raised[_BLOCK + k] = u * a0 * a1 + v * b0 * b1 + w * c0 * c1
        raised[2 * _BLOCK + k] = u * a0 * a2 + v * b0 * b2 + w * c0 * c2
        raised[3 * _BLOCK + k] = u * a1 * a1 + v * b1 * b1 + w * c1 * c1
        raised[4 * _BLOCK + k] = u * a1 * a2 + v * b1 * b2 + w * c1 * c2
        raised[5 * _BLOCK + k] = u * a2 * a2 + v * b2 * b2 + w * c2 * c2


@kernel
def _take_block(packed: Matrix, start: int, count: int, entries: Vector) -> None:
    """Copy a block of matrices entry by entry, as vector units read them."""
    for k in range(count):
        for entry in range(6):
            entries[entry * _BLOCK + k] = packed[start + k, entry]


@kernel
def floored_covariances(packed: Matrix, least: float, ratio: float) -> tuple[Matrix, Matrix]:
    """Return covariances with no principal variance below a floor, and those variances.

    Covariances are (k, 6) packed upper triangles; the floor is the larger of `least` and `ratio`
    times the largest variance of the same matrix. The (k, 3) variances ascend.
    """
    n = packed.shape[0]
    regularised, variances = np.empty((n, 6), np.float64), np.empty((n, 3), np.float64)
    entries, turned = np.zeros(6 * _BLOCK, np.float64), np.empty(12 * _BLOCK, np.float64)
    raised = np.empty(6 * _BLOCK, np.float64)
    for start in range(0, n, _BLOCK):
        count = min(_BLOCK, n - start)
        _take_block(packed, start, count, entries)
        _turn_block(entries, turned)
        _raise_block(turned, least, ratio, raised)
        for k in range(count):
            for entry in range(6):
                regularised[start + k, entry] = raised[entry * _BLOCK + k]
            for entry in range(3):
                variances[start + k, entry] = turned[entry * _BLOCK + k]
    return regularised, variances


@kernel
def principal_axes(packed: Matrix) -> tuple[Matrix, Matrix]:
    """Return the (n, 3) variances, ascending, and their (n, 9) axes, one after the other.

    Covariances are (n, 6) packed upper triangles. Unlike closed formulas, turns keep the axes
    orthonormal to rounding where variances are equal or zero. Each axis is a unit vector of
    either sign.
    """
    n = packed.shape[0]
    variances, axes = np.empty((n, 3), np.float64), np.empty((n, 9), np.float64)
    entries, turned = np.zeros(6 * _BLOCK, np.float64), np.empty(12 * _BLOCK, np.float64)
    for start in range(0, n, _BLOCK):
        count = min(_BLOCK, n - start)
        _take_block(packed, start, count, entries)
        _turn_block(entries, turned)
        for k in range(count):
            for entry in range(3):
                variances[start + k, entry] = turned[entry * _BLOCK + k]
            for entry in range(9):
                axes[start + k, entry] = turned[(3 + entry) * _BLOCK + k]
    return variances, axes
