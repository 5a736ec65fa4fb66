"""Eigendecomposition of symmetric 3x3 matrices, and regularisation of covariances.

Jacobi's method in a fixed number of sweeps without a branch, so that vector units rotate several
matrices at once. This takes a tenth of the time of iterating each matrix until it converges.
"""

import math

import numpy as np

from scanlock.arrays import Matrix, Vector
from scanlock.kernels._compile import helper, inlined, kernel, sum_helper
from scanlock.kernels._inline import Symmetric, Triple

_BLOCK = 128
"""Matrices in a block, few enough for the block to stay in the first-level cache."""

_TINY = 1e-300
"""Added to a denominator, so that an entry that is zero is rotated by 0, not by 0 / 0."""


@inlined
def _jacobi_rotation(
    app: float, aqq: float, apq: float, arp: float, arq: float
) -> tuple[float, float, float, float, float, float]:
    """Return entries pp, qq, rp, rq after the rotation that zeroes pq, and its cosine and sine."""
    d = aqq - app
    twice = 2.0 * apq
    # The smaller of the two possible angles.
    t = math.copysign(1.0, d) * twice / (abs(d) + math.sqrt(d * d + twice * twice) + _TINY)
    c = 1.0 / math.sqrt(1.0 + t * t)
    s = t * c
    return app - t * apq, aqq + t * apq, c * arp - s * arq, s * arp + c * arq, c, s


@inlined
def _rotated_axes(c: float, s: float, a: Triple, b: Triple) -> tuple[Triple, Triple]:
    """Return two axes after the rotation of cosine c and sine s that mixes them."""
    return (
        (c * a[0] - s * b[0], c * a[1] - s * b[1], c * a[2] - s * b[2]),
        (s * a[0] + c * b[0], s * a[1] + c * b[1], s * a[2] + c * b[2]),
    )


@inlined
def _sweep(
    m: Symmetric, x: Triple, y: Triple, z: Triple
) -> tuple[Symmetric, Triple, Triple, Triple]:
    """Return a symmetric matrix and its axes x, y, z after one rotation about each axis."""
    xx, xy, xz, yy, yz, zz = m
    xx, yy, xz, yz, c, s = _jacobi_rotation(xx, yy, xy, xz, yz)
    x, y = _rotated_axes(c, s, x, y)
    xx, zz, xy, yz, c, s = _jacobi_rotation(xx, zz, xz, 0.0, yz)
    x, z = _rotated_axes(c, s, x, z)
    yy, zz, xy, xz, c, s = _jacobi_rotation(yy, zz, yz, xy, 0.0)
    y, z = _rotated_axes(c, s, y, z)
    return (xx, xy, xz, yy, 0.0, zz), x, y, z


@inlined
def _ordered(u: float, a: Triple, v: float, b: Triple) -> tuple[float, Triple, float, Triple]:
    """Return two eigenvalues with their axes, the smaller first."""
    swaps = u > v
    a0, a1, a2 = a
    b0, b1, b2 = b
    return (
        v if swaps else u,
        (b0 if swaps else a0, b1 if swaps else a1, b2 if swaps else a2),
        u if swaps else v,
        (a0 if swaps else b0, a1 if swaps else b1, a2 if swaps else b2),
    )


@sum_helper
def _decompose_block(entries: Vector, eigen: Vector) -> None:
    """Write the ascending eigenvalues (3 rows) and the axes (9 rows) of packed matrices (6 rows).

    Rows of a fixed length in flat arrays, because only then the compiler sees that none overlap.
    """
    for k in range(_BLOCK):
        m = (
            entries[k], entries[_BLOCK + k], entries[2 * _BLOCK + k],
            entries[3 * _BLOCK + k], entries[4 * _BLOCK + k], entries[5 * _BLOCK + k],
        )  # fmt: skip
        x, y, z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
        # Five sweeps converge to the last digit for any matrix. Unrolled, because an inner loop
        # would keep the outer one from using vector units.
        m, x, y, z = _sweep(m, x, y, z)
        m, x, y, z = _sweep(m, x, y, z)
        m, x, y, z = _sweep(m, x, y, z)
        m, x, y, z = _sweep(m, x, y, z)
        m, x, y, z = _sweep(m, x, y, z)
        u, v, w = m[0], m[3], m[5]
        u, x, v, y = _ordered(u, x, v, y)
        u, x, w, z = _ordered(u, x, w, z)
        v, y, w, z = _ordered(v, y, w, z)
        eigen[k], eigen[_BLOCK + k], eigen[2 * _BLOCK + k] = u, v, w
        eigen[3 * _BLOCK + k], eigen[4 * _BLOCK + k], eigen[5 * _BLOCK + k] = x
        eigen[6 * _BLOCK + k], eigen[7 * _BLOCK + k], eigen[8 * _BLOCK + k] = y
        eigen[9 * _BLOCK + k], eigen[10 * _BLOCK + k], eigen[11 * _BLOCK + k] = z


@sum_helper
def _regularise_block(eigen: Vector, min_variance: float, min_ratio: float, packed: Vector) -> None:
    """Raise the variances of a block in place, and write the packed covariances (6 rows)."""
    for k in range(_BLOCK):
        minimum = max(min_variance, min_ratio * eigen[2 * _BLOCK + k])
        u = max(eigen[k], minimum)
        v = max(eigen[_BLOCK + k], minimum)
        w = max(eigen[2 * _BLOCK + k], minimum)
        a0, a1, a2 = eigen[3 * _BLOCK + k], eigen[4 * _BLOCK + k], eigen[5 * _BLOCK + k]
        b0, b1, b2 = eigen[6 * _BLOCK + k], eigen[7 * _BLOCK + k], eigen[8 * _BLOCK + k]
        c0, c1, c2 = eigen[9 * _BLOCK + k], eigen[10 * _BLOCK + k], eigen[11 * _BLOCK + k]
        eigen[k], eigen[_BLOCK + k], eigen[2 * _BLOCK + k] = u, v, w
        packed[k] = u * a0 * a0 + v * b0 * b0 + w * c0 * c0
        packed[_BLOCK + k] = u * a0 * a1 + v * b0 * b1 + w * c0 * c1
        packed[2 * _BLOCK + k] = u * a0 * a2 + v * b0 * b2 + w * c0 * c2
        packed[3 * _BLOCK + k] = u * a1 * a1 + v * b1 * b1 + w * c1 * c1
        packed[4 * _BLOCK + k] = u * a1 * a2 + v * b1 * b2 + w * c1 * c2
        packed[5 * _BLOCK + k] = u * a2 * a2 + v * b2 * b2 + w * c2 * c2


@helper
def _copy_block(packed: Matrix, start: int, count: int, entries: Vector) -> None:
    """Copy a block of packed matrices to rows of equal entries, as vector units read them."""
    for k in range(count):
        for entry in range(6):
            entries[entry * _BLOCK + k] = packed[start + k, entry]


@kernel
def regularised_covariances(
    packed: Matrix, min_variance: float, min_ratio: float
) -> tuple[Matrix, Matrix]:
    """Return covariances with raised principal variances, and those variances.

    Parameters
    ----------
    packed : (k, 6) [m^2]
        Upper triangles.
    min_variance : float [m^2]
        Smallest principal variance.
    min_ratio : float
        Smallest principal variance relative to the largest of the same matrix.

    Returns
    -------
    regularised : (k, 6) [m^2]
    variances : (k, 3) [m^2]
        Ascending.
    """
    n = packed.shape[0]
    regularised, variances = np.empty((n, 6), np.float64), np.empty((n, 3), np.float64)
    entries, eigen = np.zeros(6 * _BLOCK, np.float64), np.empty(12 * _BLOCK, np.float64)
    block = np.empty(6 * _BLOCK, np.float64)
    for start in range(0, n, _BLOCK):
        count = min(_BLOCK, n - start)
        _copy_block(packed, start, count, entries)
        _decompose_block(entries, eigen)
        _regularise_block(eigen, min_variance, min_ratio, block)
        for k in range(count):
            for entry in range(6):
                regularised[start + k, entry] = block[entry * _BLOCK + k]
            for entry in range(3):
                variances[start + k, entry] = eigen[entry * _BLOCK + k]
    return regularised, variances


@kernel
def principal_axes(packed: Matrix) -> tuple[Matrix, Matrix]:
    """Return the (n, 3) variances, ascending, and their (n, 9) axes, one after the other.

    Covariances are (n, 6) packed upper triangles. Unlike closed formulas, rotations keep the axes
    orthonormal to rounding where variances are equal or zero. The sign of an axis is arbitrary.
    """
    n = packed.shape[0]
    variances, axes = np.empty((n, 3), np.float64), np.empty((n, 9), np.float64)
    entries, eigen = np.zeros(6 * _BLOCK, np.float64), np.empty(12 * _BLOCK, np.float64)
    for start in range(0, n, _BLOCK):
        count = min(_BLOCK, n - start)
        _copy_block(packed, start, count, entries)
        _decompose_block(entries, eigen)
        for k in range(count):
            for entry in range(3):
                variances[start + k, entry] = eigen[entry * _BLOCK + k]
            for entry in range(9):
                axes[start + k, entry] = eigen[(3 + entry) * _BLOCK + k]
    return variances, axes
