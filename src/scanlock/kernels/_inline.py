"""Helpers that are compiled into the kernels that call them.

Vectors and matrices are tuples of numbers, which cost nothing after compilation: ``(x, y, z)``, the
nine entries of a rotation row by row, and the upper triangle xx, xy, xz, yy, yz, zz of a symmetric
3x3 matrix. The 28 terms of an objective are its value, its gradient (6) and the upper triangle of
its Hessian, row by row (21).
"""

import numpy as np

from scanlock.arrays import Labels, Matrix, Vector
from scanlock.kernels._compile import inlined

_LOW_BITS = (1 << 20) - 1
"""Bits of an index that the hash uses, so that no product overflows."""

Triple = tuple[float, float, float]
Symmetric = tuple[float, float, float, float, float, float]
Nine = tuple[float, float, float, float, float, float, float, float, float]
Terms = tuple[float, ...]

NO_TERMS: Terms = (0.0,) * 28
"""Sums of 28 terms before the first is added."""


@inlined
def first_not_below(ascending: Vector, begin: int, end: int, value: float) -> int:
    """Return the first row in [begin, end) whose number is not below a value, or `end`."""
    while begin < end:
        middle = (begin + end) // 2
        if ascending[middle] < value:
            begin = middle + 1
        else:
            end = middle
    return begin


@inlined
def voxel_slot(i: int, j: int, k: int, last: int) -> int:
    """Return the hash of a voxel, from 0 to `last` = ``2**b - 1`` (Teschner et al. 2003)."""
    return (
        ((i & _LOW_BITS) * 73856093) ^ ((j & _LOW_BITS) * 19349663) ^ ((k & _LOW_BITS) * 83492791)
    ) & last


@inlined
def find_voxel(table: Labels, voxels: Labels, i: int, j: int, k: int) -> tuple[int, int]:
    """Return the slot and the row of a voxel in a hash table with linear probing.

    A voxel that is not in the table has row -1 and the empty slot that it belongs in. `table`
    holds rows of `voxels` (m, 3), -1 where empty; its length is a power of two above m.
    """
    last = table.shape[0] - 1
    slot = voxel_slot(i, j, k, last)
    row = int(table[slot])
    while row >= 0 and not (voxels[row, 0] == i and voxels[row, 1] == j and voxels[row, 2] == k):
        slot = (slot + 1) & last
        row = int(table[slot])
    return slot, row


@inlined
def triple(vector: Vector) -> Triple:
    """Return the three numbers of an array."""
    return vector[0], vector[1], vector[2]


@inlined
def nine(matrix: Matrix) -> Nine:
    """Return the entries of a 3x3 array, row by row."""
    return (
        matrix[0, 0], matrix[0, 1], matrix[0, 2],
        matrix[1, 0], matrix[1, 1], matrix[1, 2],
        matrix[2, 0], matrix[2, 1], matrix[2, 2],
    )  # fmt: skip


@inlined
def symmetric(packed: Matrix, row: int | np.uint64) -> Symmetric:
    """Return a row of (n, 6) packed matrices."""
    return (
        packed[row, 0], packed[row, 1], packed[row, 2],
        packed[row, 3], packed[row, 4], packed[row, 5],
    )  # fmt: skip


@inlined
def put_symmetric(packed: Matrix, row: int, matrix: Symmetric) -> None:
    """Write a row of (n, 6) packed matrices."""
    xx, xy, xz, yy, yz, zz = matrix
    packed[row, 0], packed[row, 1], packed[row, 2] = xx, xy, xz
    packed[row, 3], packed[row, 4], packed[row, 5] = yy, yz, zz


@inlined
def transformed(r: Nine, t: Triple, x: float, y: float, z: float) -> Triple:
    """Return ``R p + t``."""
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = r
    t0, t1, t2 = t
    return (
        r00 * x + r01 * y + r02 * z + t0,
        r10 * x + r11 * y + r12 * z + t1,
        r20 * x + r21 * y + r22 * z + t2,
    )


@inlined
def rotated(r: Nine, c: Symmetric) -> Symmetric:
    """Return ``R C R'``."""
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = r
    xx, xy, xz, yy, yz, zz = c
    # First the product R C.
    h00, h01, h02 = (
        r00 * xx + r01 * xy + r02 * xz,
        r00 * xy + r01 * yy + r02 * yz,
        r00 * xz + r01 * yz + r02 * zz,
    )
    h10, h11, h12 = (
        r10 * xx + r11 * xy + r12 * xz,
        r10 * xy + r11 * yy + r12 * yz,
        r10 * xz + r11 * yz + r12 * zz,
    )
    h20, h21, h22 = (
        r20 * xx + r21 * xy + r22 * xz,
        r20 * xy + r21 * yy + r22 * yz,
        r20 * xz + r21 * yz + r22 * zz,
    )
    return (
        h00 * r00 + h01 * r01 + h02 * r02,
        h00 * r10 + h01 * r11 + h02 * r12,
        h00 * r20 + h01 * r21 + h02 * r22,
        h10 * r10 + h11 * r11 + h12 * r12,
        h10 * r20 + h11 * r21 + h12 * r22,
        h20 * r20 + h21 * r21 + h22 * r22,
    )


@inlined
def adjugate(s: Symmetric) -> tuple[Symmetric, float]:
    """Return the adjugate of a symmetric matrix and its determinant."""
    xx, xy, xz, yy, yz, zz = s
    axx = yy * zz - yz * yz
    axy = xz * yz - xy * zz
    axz = xy * yz - xz * yy
    ayy = xx * zz - xz * xz
    ayz = xy * xz - xx * yz
    azz = xx * yy - xy * xy
    return (axx, axy, axz, ayy, ayz, azz), xx * axx + xy * axy + xz * axz


@inlined
def inverse(s: Symmetric) -> Symmetric:
    """Return the inverse of a symmetric matrix; infinities or NaN if it is singular."""
    (axx, axy, axz, ayy, ayz, azz), determinant = adjugate(s)
    scale = 1.0 / determinant
    return scale * axx, scale * axy, scale * axz, scale * ayy, scale * ayz, scale * azz


@inlined
def summed(c: Symmetric, d: Symmetric) -> Symmetric:
    """Return the sum of two symmetric matrices."""
    return c[0] + d[0], c[1] + d[1], c[2] + d[2], c[3] + d[3], c[4] + d[4], c[5] + d[5]


@inlined
def product(s: Symmetric, v: Triple) -> Triple:
    """Return the product of a symmetric matrix and a vector."""
    xx, xy, xz, yy, yz, zz = s
    x, y, z = v
    return xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z


@inlined
def dot(v: Triple, w: Triple) -> float:
    """Return the scalar product of two vectors."""
    return v[0] * w[0] + v[1] * w[1] + v[2] * w[2]


@inlined
def quadratic_form(s: Symmetric, v: Triple) -> float:
    """Return ``v' S v``."""
    xx, xy, xz, yy, yz, zz = s
    x, y, z = v
    return x * (xx * x + 2.0 * (xy * y + xz * z)) + y * (yy * y + 2.0 * yz * z) + zz * z * z


@inlined
def exp_negative(x: float) -> float:
    """Return ``exp(-x)`` for x >= 0 to 1e-13, in arithmetic that loops can vectorise.

    The Taylor series of ``exp(-x / 64)``, squared six times; math.exp is a call.
    """
    y = -0.015625 * min(x, 60.0)
    e = 1.0 + y * (1.0 / 7.0) * (1.0 + y * 0.125 * (1.0 + y * (1.0 / 9.0)))
    e = 1.0 + y * 0.25 * (1.0 + y * 0.2 * (1.0 + y * (1.0 / 6.0) * e))
    e = 1.0 + y * (1.0 + y * 0.5 * (1.0 + y * (1.0 / 3.0) * e))
    e *= e
    e *= e
    e *= e
    e *= e
    e *= e
    return e * e


@inlined
def window(v: float) -> Triple:
    """Return the window of a score, which falls from 1 at 0 to 0 at 1, and its two derivatives.

    Both derivatives are 0 at either end.
    """
    return (
        1.0 - v * v * v * (10.0 - 15.0 * v + 6.0 * v * v),
        -30.0 * v * v * (1.0 - v) * (1.0 - v),
        -60.0 * v * (1.0 - v) * (1.0 - 2.0 * v),
    )


@inlined
def windowed(score: float, slope: float, curve: float, w: float, w1: float, w2: float) -> Triple:
    """Return the product of a score and a window with its two derivatives."""
    return (
        score * w,
        slope * w + score * w1,
        curve * w + 2.0 * slope * w1 + score * w2,
    )


@inlined
def windowed_score(weight: float, squared: float, sharpness: float, limits: Triple) -> Triple:
    """Return ``-w exp(-sharpness s / 2) W(s)`` and its first two derivatives in s.

    `limits` are the start of the window W and the powers -1 and -2 of the length of its fall.
    """
    score = -weight * exp_negative(0.5 * sharpness * squared)
    slope = -0.5 * sharpness * score
    curve = -0.5 * sharpness * slope
    start, scale1, scale2 = limits
    # Clamped to the window: 1 up to its start, 0 from its end on.
    w, w1, w2 = window(min(1.0, max(0.0, (squared - start) * scale1)))
    return windowed(score, slope, curve, w, w1 * scale1, w2 * scale2)


@inlined
def added(s: Terms, t: Terms) -> Terms:
    """Return sums with 28 terms added."""
    return (
        s[0] + t[0], s[1] + t[1], s[2] + t[2], s[3] + t[3], s[4] + t[4], s[5] + t[5],
        s[6] + t[6], s[7] + t[7], s[8] + t[8], s[9] + t[9], s[10] + t[10], s[11] + t[11],
        s[12] + t[12], s[13] + t[13], s[14] + t[14], s[15] + t[15], s[16] + t[16],
        s[17] + t[17], s[18] + t[18], s[19] + t[19], s[20] + t[20], s[21] + t[21],
        s[22] + t[22], s[23] + t[23], s[24] + t[24], s[25] + t[25], s[26] + t[26],
        s[27] + t[27],
    )  # fmt: skip


@inlined
def add_to(sums: Vector, t: Terms) -> None:
    """Add 28 terms to an array."""
    sums[0] += t[0]
    sums[1] += t[1]
    sums[2] += t[2]
    sums[3] += t[3]
    sums[4] += t[4]
    sums[5] += t[5]
    sums[6] += t[6]
    sums[7] += t[7]
    sums[8] += t[8]
    sums[9] += t[9]
    sums[10] += t[10]
    sums[11] += t[11]
    sums[12] += t[12]
    sums[13] += t[13]
    sums[14] += t[14]
    sums[15] += t[15]
    sums[16] += t[16]
    sums[17] += t[17]
    sums[18] += t[18]
    sums[19] += t[19]
    sums[20] += t[20]
    sums[21] += t[21]
    sums[22] += t[22]
    sums[23] += t[23]
    sums[24] += t[24]
    sums[25] += t[25]
    sums[26] += t[26]
    sums[27] += t[27]


@inlined
def add_point_terms(
    terms: Vector, value: float, y: Triple, g: Triple, h: Symmetric, exact: float
) -> None:
    """Add the 28 terms of a function of a point y, for a step ``(rho, phi)`` of the pose.

    With the gradient g and the Hessian H of the function in y::

        gradient  (g, y x g)
        Hessian   J' H J + blkdiag(0, exact ((g y' + y g') / 2 - (g.y) I)),  J = [I, -hat(y)]

    Each term is added as soon as it is known: in pairs of points this is 7 % faster than adding
    a tuple of them, as `p2d` must do for the sake of vector units.
    """
    y0, y1, y2 = y
    g0, g1, g2 = g
    h00, h01, h02, h11, h12, h22 = h
    # N = H hat(y); J' H J has the blocks H, -N and hat(y)' N.
    n00, n01, n02 = h01 * y2 - h02 * y1, h02 * y0 - h00 * y2, h00 * y1 - h01 * y0
    n10, n11, n12 = h11 * y2 - h12 * y1, h12 * y0 - h01 * y2, h01 * y1 - h11 * y0
    n20, n21, n22 = h12 * y2 - h22 * y1, h22 * y0 - h02 * y2, h02 * y1 - h12 * y0
    half0, half1, half2 = 0.5 * exact * g0, 0.5 * exact * g1, 0.5 * exact * g2
    terms[0] += value
    terms[1] += g0
    terms[2] += g1
    terms[3] += g2
    terms[4] += y1 * g2 - y2 * g1
    terms[5] += y2 * g0 - y0 * g2
    terms[6] += y0 * g1 - y1 * g0
    terms[7] += h00
    terms[8] += h01
    terms[9] += h02
    terms[10] -= n00
    terms[11] -= n01
    terms[12] -= n02
    terms[13] += h11
    terms[14] += h12
    terms[15] -= n10
    terms[16] -= n11
    terms[17] -= n12
    terms[18] += h22
    terms[19] -= n20
    terms[20] -= n21
    terms[21] -= n22
    terms[22] += y2 * n10 - y1 * n20 - 2.0 * (half1 * y1 + half2 * y2)
    terms[23] += y2 * n11 - y1 * n21 + half0 * y1 + half1 * y0
    terms[24] += y2 * n12 - y1 * n22 + half0 * y2 + half2 * y0
    terms[25] += y0 * n21 - y2 * n01 - 2.0 * (half0 * y0 + half2 * y2)
    terms[26] += y0 * n22 - y2 * n02 + half1 * y2 + half2 * y1
    terms[27] += y1 * n02 - y0 * n12 - 2.0 * (half0 * y0 + half1 * y1)
