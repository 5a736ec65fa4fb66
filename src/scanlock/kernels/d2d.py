"""Sums of the scores of pairs of Gaussians with their derivatives: D2D.

The score of a pair at squared Mahalanobis distance ``s`` is ``-w exp(-sharpness s / 2) W(s)``,
with a window W that falls from 1 at `window_start` to 0 at `window_end` with two continuous
derivatives, so that leaving out pairs beyond the end changes nothing a solver can see.

With ``y`` the mean of the source in the target's frame, ``C = R C_s R'`` its covariance there,
``q = y - mu``, ``B = (C + C_t)^-1``, ``b = B q`` and ``u = y - C b``, the squared distance
``s = q' B q`` has, for the step ``(rho, phi)``::

    gradient  2 (b, u x b)
    Hessian   2 L' B L + blkdiag(0, b u' + u b' - 2 (b.u) I + 2 hat(b) C hat(b))
    with      L = [I, -M],  M = hat(u) + C hat(b)

which is Stoyanov et al. 2012 in a left perturbation, the turning covariance included. The sums
are 28: the value, the gradient (6) and the upper triangle of the Hessian, row by row (21); with
`exact` 0 instead of 1 the Hessian is its convex part, that of Gauss and Newton.

Most pairs that are looked at are too far apart to count, and what is left is done several at a
time by vector units, which want loops without branches over arrays without gaps. So pairs go
through blocks of scratch memory, small enough for the nearest cache: those near enough by the
bound on their distance, then those within the window, then the terms of these. One row of
scratch holds one number of all pairs of the block.
"""

import numpy as np

from scanlock.arrays import Labels, Matrix, Vector
from scanlock.kernels._compile import kernel, sum_kernel

_BLOCK = 256
"""Pairs done at a time, and candidates looked at between two looks at how many there are."""

_ROW = 2 * _BLOCK + 24
"""Length of a row of scratch. Not a power of two: rows would share a few lines of the cache."""

_LOG2E = 1.4426950408889634
_LN2_HIGH = 6.93147180369123816490e-01
_LN2_LOW = 1.90821492927058770002e-10
"""The logarithm of 2 in two parts, the first with so few digits that its products are exact."""

_TO_WHOLE = 6755399441055744.0
"""1.5 * 2^52: a number added to it is rounded, its whole part in the lowest bits of the sum."""


@kernel
def _exponentials(exponents: Vector, whole: Vector, powers: Vector, count: int) -> None:
    """Replace numbers from -700 to 0 by their exponentials, to 1e-15 of each.

    ``exp(x) = 2^k exp(r)`` with a whole k and ``|r| <= ln 2 / 2``. Three loops, so that bits
    written as one type are read as the other; the library's function would do one at a time.
    """
    bits, power_bits = whole.view(np.int64), powers.view(np.int64)
    for m in range(count):
        whole[m] = exponents[m] * _LOG2E + _TO_WHOLE
    for m in range(count):
        power_bits[m] = (bits[m] + 1023) << 52
    for m in range(count):
        k = whole[m] - _TO_WHOLE
        r = (exponents[m] - k * _LN2_HIGH) - k * _LN2_LOW
        # The series of exp, whose rest is below a unit in the last place for these r.
        p = 1.0 / 479001600.0
        p = p * r + 1.0 / 39916800.0
        p = p * r + 1.0 / 3628800.0
        p = p * r + 1.0 / 362880.0
        p = p * r + 1.0 / 40320.0
        p = p * r + 1.0 / 5040.0
        p = p * r + 1.0 / 720.0
        p = p * r + 1.0 / 120.0
        p = p * r + 1.0 / 24.0
        p = p * r + 1.0 / 6.0
        p = p * r + 0.5
        p = p * r + 1.0
        p = p * r + 1.0
        exponents[m] = p * powers[m]


@sum_kernel
def _invert(pairs: Matrix, count: int) -> None:
    """Replace means and covariances of the targets by b, B and the squared distance."""
    for a in range(9):
        sign = -1.0 if a < 3 else 1.0
        for m in range(count):
            pairs[a, m] = pairs[10 + a, m] + sign * pairs[a, m]
    for m in range(count):
        q0, q1, q2 = pairs[0, m], pairs[1, m], pairs[2, m]
        s00, s01, s02 = pairs[3, m], pairs[4, m], pairs[5, m]
        s11, s12, s22 = pairs[6, m], pairs[7, m], pairs[8, m]
        a00 = s11 * s22 - s12 * s12
        a01 = s02 * s12 - s01 * s22
        a02 = s01 * s12 - s02 * s11
        inverse = 1.0 / (s00 * a00 + s01 * a01 + s02 * a02)
        k00, k01, k02 = a00 * inverse, a01 * inverse, a02 * inverse
        k11 = (s00 * s22 - s02 * s02) * inverse
        k12 = (s01 * s02 - s00 * s12) * inverse
        k22 = (s00 * s11 - s01 * s01) * inverse
        b0 = k00 * q0 + k01 * q1 + k02 * q2
        b1 = k01 * q0 + k11 * q1 + k12 * q2
        b2 = k02 * q0 + k12 * q1 + k22 * q2
        pairs[9, m] = b0 * q0 + b1 * q1 + b2 * q2
        pairs[0, m], pairs[1, m], pairs[2, m] = b0, b1, b2
        pairs[3, m], pairs[4, m], pairs[5, m] = k00, k01, k02
        pairs[6, m], pairs[7, m], pairs[8, m] = k11, k12, k22


@sum_kernel
def _score(
    pairs: Matrix, count: int, sharpness: float, window_start: float, window_end: float
) -> float:
    """Turn squared distances and weights into twice the slope and four times the curve.

    Rows 9 and 19 of `pairs` are replaced; row 20 holds the exponentials. Returned is the sum of
    the scores.
    """
    span = 1.0 / (window_end - window_start)
    total = 0.0
    for m in range(count):
        s = pairs[9, m]
        score = -pairs[19, m] * pairs[20, m]
        slope = -0.5 * sharpness * score
        curve = -0.5 * sharpness * slope
        v = min(max(0.0, (s - window_start) * span), 1.0)
        window = 1.0 - v * v * v * (10.0 - 15.0 * v + 6.0 * v * v)
        first = -30.0 * v * v * (1.0 - v) * (1.0 - v) * span
        second = -60.0 * v * (1.0 - v) * (1.0 - 2.0 * v) * span * span
        total += score * window
        pairs[9, m] = 2.0 * (slope * window + score * first)
        pairs[19, m] = 4.0 * (curve * window + 2.0 * slope * first + score * second)
    return total


@sum_kernel
def _add(terms: Vector, pairs: Matrix, count: int, exact: float) -> None:
    """Add the gradients and Hessians of the first pairs of a block to the 28 sums.

    Rows of `pairs`: b, B, twice the slope, y, C and four times the curve.
    """
    t1 = t2 = t3 = t4 = t5 = t6 = 0.0
    t7 = t8 = t9 = t10 = t11 = t12 = t13 = t14 = t15 = t16 = t17 = 0.0
    t18 = t19 = t20 = t21 = t22 = t23 = t24 = t25 = t26 = t27 = 0.0
    for m in range(count):
        b0, b1, b2 = pairs[0, m], pairs[1, m], pairs[2, m]
        k00, k01, k02 = pairs[3, m], pairs[4, m], pairs[5, m]
        k11, k12, k22 = pairs[6, m], pairs[7, m], pairs[8, m]
        slope, curve = pairs[9, m], exact * pairs[19, m]
        c00, c01, c02 = pairs[13, m], pairs[14, m], pairs[15, m]
        c11, c12, c22 = pairs[16, m], pairs[17, m], pairs[18, m]
        u0 = pairs[10, m] - (c00 * b0 + c01 * b1 + c02 * b2)
        u1 = pairs[11, m] - (c01 * b0 + c11 * b1 + c12 * b2)
        u2 = pairs[12, m] - (c02 * b0 + c12 * b1 + c22 * b2)
        # D = C hat(b) and M = hat(u) + D.
        d00, d01, d02 = c01 * b2 - c02 * b1, c02 * b0 - c00 * b2, c00 * b1 - c01 * b0
        d10, d11, d12 = c11 * b2 - c12 * b1, c12 * b0 - c01 * b2, c01 * b1 - c11 * b0
        d20, d21, d22 = c12 * b2 - c22 * b1, c22 * b0 - c02 * b2, c02 * b1 - c12 * b0
        m01, m02, m10 = d01 - u2, d02 + u1, d10 + u2
        m12, m20, m21 = d12 - u0, d20 - u1, d21 + u0
        # N = slope B M; slope L' B L has the blocks slope B, -N and M' N.
        k00, k01, k02 = slope * k00, slope * k01, slope * k02
        k11, k12, k22 = slope * k11, slope * k12, slope * k22
        n00 = k00 * d00 + k01 * m10 + k02 * m20
        n01 = k00 * m01 + k01 * d11 + k02 * m21
        n02 = k00 * m02 + k01 * m12 + k02 * d22
        n10 = k01 * d00 + k11 * m10 + k12 * m20
        n11 = k01 * m01 + k11 * d11 + k12 * m21
        n12 = k01 * m02 + k11 * m12 + k12 * d22
        n20 = k02 * d00 + k12 * m10 + k22 * m20
        n21 = k02 * m01 + k12 * d11 + k22 * m21
        n22 = k02 * m02 + k12 * m12 + k22 * d22
        # Half the gradient of s is (b, g).
        g0, g1, g2 = u1 * b2 - u2 * b1, u2 * b0 - u0 * b2, u0 * b1 - u1 * b0
        t1 += slope * b0
        t2 += slope * b1
        t3 += slope * b2
        t4 += slope * g0
        t5 += slope * g1
        t6 += slope * g2
        v0, v1, v2 = curve * b0, curve * b1, curve * b2
        w0, w1, w2 = curve * g0, curve * g1, curve * g2
        t7 += k00 + v0 * b0
        t8 += k01 + v0 * b1
        t9 += k02 + v0 * b2
        t10 += v0 * g0 - n00
        t11 += v0 * g1 - n01
        t12 += v0 * g2 - n02
        t13 += k11 + v1 * b1
        t14 += k12 + v1 * b2
        t15 += v1 * g0 - n10
        t16 += v1 * g1 - n11
        t17 += v1 * g2 - n12
        t18 += k22 + v2 * b2
        t19 += v2 * g0 - n20
        t20 += v2 * g1 - n21
        t21 += v2 * g2 - n22
        # The rest of the Hessian's rotation block: halves of b u' + u b' and hat(b) C hat(b).
        slope = exact * slope
        dot = b0 * u0 + b1 * u1 + b2 * u2
        e00 = b0 * u0 - dot + b1 * d20 - b2 * d10
        e11 = b1 * u1 - dot + b2 * d01 - b0 * d21
        e22 = b2 * u2 - dot + b0 * d12 - b1 * d02
        e01 = 0.5 * (b0 * u1 + b1 * u0) + b1 * d21 - b2 * d11
        e02 = 0.5 * (b0 * u2 + b2 * u0) + b1 * d22 - b2 * d12
        e12 = 0.5 * (b1 * u2 + b2 * u1) + b2 * d02 - b0 * d22
        t22 += d00 * n00 + m10 * n10 + m20 * n20 + slope * e00 + w0 * g0
        t23 += d00 * n01 + m10 * n11 + m20 * n21 + slope * e01 + w0 * g1
        t24 += d00 * n02 + m10 * n12 + m20 * n22 + slope * e02 + w0 * g2
        t25 += m01 * n01 + d11 * n11 + m21 * n21 + slope * e11 + w1 * g1
        t26 += m01 * n02 + d11 * n12 + m21 * n22 + slope * e12 + w1 * g2
        t27 += m02 * n02 + m12 * n12 + d22 * n22 + slope * e22 + w2 * g2
    terms[1:7] += np.array([t1, t2, t3, t4, t5, t6])
    terms[7:18] += np.array([t7, t8, t9, t10, t11, t12, t13, t14, t15, t16, t17])
    terms[18:28] += np.array([t18, t19, t20, t21, t22, t23, t24, t25, t26, t27])


@kernel
def _turn(source: Matrix, i: int, rotation: Matrix, translation: Vector, moved: Vector) -> None:
    """Write mean and covariance of source i, in the target's frame, into `moved`."""
    r00, r01, r02 = rotation[0, 0], rotation[0, 1], rotation[0, 2]
    r10, r11, r12 = rotation[1, 0], rotation[1, 1], rotation[1, 2]
    r20, r21, r22 = rotation[2, 0], rotation[2, 1], rotation[2, 2]
    x0, x1, x2 = source[i, 0], source[i, 1], source[i, 2]
    moved[0] = r00 * x0 + r01 * x1 + r02 * x2 + translation[0]
    moved[1] = r10 * x0 + r11 * x1 + r12 * x2 + translation[1]
    moved[2] = r20 * x0 + r21 * x1 + r22 * x2 + translation[2]
    s0, s1, s2 = source[i, 3], source[i, 4], source[i, 5]
    s3, s4, s5 = source[i, 6], source[i, 7], source[i, 8]
    # First the half product R C.
    h00, h01 = r00 * s0 + r01 * s1 + r02 * s2, r00 * s1 + r01 * s3 + r02 * s4
    h02, h10 = r00 * s2 + r01 * s4 + r02 * s5, r10 * s0 + r11 * s1 + r12 * s2
    h11, h12 = r10 * s1 + r11 * s3 + r12 * s4, r10 * s2 + r11 * s4 + r12 * s5
    h20, h21 = r20 * s0 + r21 * s1 + r22 * s2, r20 * s1 + r21 * s3 + r22 * s4
    h22 = r20 * s2 + r21 * s4 + r22 * s5
    moved[3] = h00 * r00 + h01 * r01 + h02 * r02
    moved[4] = h00 * r10 + h01 * r11 + h02 * r12
    moved[5] = h00 * r20 + h01 * r21 + h02 * r22
    moved[6] = h10 * r10 + h11 * r11 + h12 * r12
    moved[7] = h10 * r20 + h11 * r21 + h12 * r22
    moved[8] = h20 * r20 + h21 * r21 + h22 * r22


@kernel
def _gather(
    pairs: Matrix, rows: Labels, first: int, last: int, target: Matrix, moved: Vector, weight: float
) -> None:
    """Write the numbers of a source and of the target rows to the columns of a block."""
    y0, y1, y2 = moved[0], moved[1], moved[2]
    c00, c01, c02 = moved[3], moved[4], moved[5]
    c11, c12, c22 = moved[6], moved[7], moved[8]
    for m in range(first, last):
        j = rows[m]
        pairs[0, m], pairs[1, m], pairs[2, m] = target[j, 0], target[j, 1], target[j, 2]
        pairs[3, m], pairs[4, m], pairs[5, m] = target[j, 3], target[j, 4], target[j, 5]
        pairs[6, m], pairs[7, m], pairs[8, m] = target[j, 6], target[j, 7], target[j, 8]
        pairs[10, m], pairs[11, m], pairs[12, m] = y0, y1, y2
        pairs[13, m], pairs[14, m], pairs[15, m] = c00, c01, c02
        pairs[16, m], pairs[17, m], pairs[18, m] = c11, c12, c22
        pairs[19, m] = weight * target[j, 10]


@sum_kernel
def _add_block(
    terms: Vector,
    pairs: Matrix,
    count: int,
    sharpness: float,
    window_start: float,
    window_end: float,
    exact: float,
) -> None:
    """Add the pairs of a block to the sums."""
    _invert(pairs, count)
    for m in range(count):
        pairs[20, m] = max(-700.0, -0.5 * sharpness * pairs[9, m])
    _exponentials(pairs[20], pairs[21], pairs[22], count)
    terms[0] += _score(pairs, count, sharpness, window_start, window_end)
    if exact >= 0.0:
        _add(terms, pairs, count, exact)


@kernel
def d2d_terms(
    target: Matrix,
    source: Matrix,
    lists: Labels,
    starts: Labels,
    members: Labels,
    rotation: Matrix,
    translation: Vector,
    sharpness: float,
    window_start: float,
    window_end: float,
    exact: float,
) -> Vector:
    """Return the 28 sums over pairs of Gaussians, each with the product of its weights.

    Source i meets the targets ``members[starts[l] : starts[l + 1]]`` of its list ``l = lists[i]``,
    none where that is -1, and all where there are no lists. A row of `target` (k, 11) or `source`
    (m, 11) holds mean, packed covariance, width and weight. Widths are the largest variances:
    ``s >= |q|^2 / (sum of widths)`` whatever the rotation, so a pair beyond the window is skipped
    before its matrix is inverted. With `exact` below 0 only the value is summed.
    """
    terms = np.zeros(28)
    pairs, moved = np.empty((23, _ROW)), np.empty(9)
    rows = np.empty(_ROW, np.int64)
    count = 0
    listed = lists.shape[0] > 0
    for i in range(source.shape[0]):
        first, last = 0, target.shape[0]
        if listed:
            first = starts[lists[i]] if lists[i] >= 0 else 0
            last = starts[lists[i] + 1] if lists[i] >= 0 else 0
        if first == last:
            continue
        _turn(source, i, rotation, translation, moved)
        y0, y1, y2, width = moved[0], moved[1], moved[2], source[i, 9]
        while first < last:
            stop = min(last, first + _BLOCK)
            before = count
            for m in range(first, stop):
                j = members[m] if listed else m
                q0, q1, q2 = y0 - target[j, 0], y1 - target[j, 1], y2 - target[j, 2]
                rows[count] = j
                count += q0 * q0 + q1 * q1 + q2 * q2 < window_end * (width + target[j, 9])
            _gather(pairs, rows, before, count, target, moved, source[i, 10])
            first = stop
            if count >= _BLOCK:
                _add_block(terms, pairs, count, sharpness, window_start, window_end, exact)
                count = 0
    _add_block(terms, pairs, count, sharpness, window_start, window_end, exact)
    return terms
