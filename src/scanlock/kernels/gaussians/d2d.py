"""D2D: sums of the scores of Gaussians against Gaussians, with their derivatives.

The score of a pair at squared Mahalanobis distance ``s`` is ``-w exp(-sharpness s / 2) W(s)``,
with a window W that falls from 1 at `window_start` to 0 at `window_end` with two continuous
derivatives, so that leaving out pairs beyond the end changes nothing a solver can see.

With ``y`` a mean of the source in the target's frame, ``C = R C_s R'`` its covariance there,
``q = y - mu``, ``B = (C + C_t)^-1``, ``b = B q`` and ``u = y - C b``, the squared distance
``s = q' B q`` has, for the step ``(rho, phi)``::

    gradient  2 (b, u x b)
    Hessian   2 L' B L + blkdiag(0, b u' + u b' - 2 (b.u) I + 2 hat(b) C hat(b))
    with      L = [I, -M],  M = hat(u) + C hat(b)

which is Stoyanov et al. 2012 in a left perturbation, the turning covariance included. The 28 sums
are the value, the gradient (6) and the upper triangle of the Hessian, row by row (21); with
`exact` 0 instead of 1 the Hessian is its convex part, that of Gauss and Newton.

The values of pairs are gathered in blocks, and all arithmetic is done in one loop over a block,
without a branch or a call: vector units then take eight pairs at once. Beyond the window a pair
counts exactly nothing, so pairs that are listed in vain cost time and change no sum.
"""

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector
from scanlock.kernels._compile import sum_kernel, sum_part

_BLOCK = 256
"""Pairs gathered at a time; a block stays in the cache."""

_PARTS = 19
"""Rows of a block: y (3), q (3), C (6), C + C_t (6) and the weight of each pair."""

_ROW = _BLOCK + 8
"""Length of a row. Were it a power of two, all rows would compete for few places in the cache."""


@sum_part
def _decay(x: float) -> float:
    """Return ``exp(-x)`` for x from 0 to 30 to 1e-13, in arithmetic that loops can vectorise.

    The Taylor series of ``exp(-x / 64)``, squared six times; math.exp is a call.
    """
    y = -0.015625 * min(x, 30.0)
    e = 1.0 + y * (1.0 / 7.0) * (1.0 + y * 0.125 * (1.0 + y * (1.0 / 9.0)))
    e = 1.0 + y * 0.25 * (1.0 + y * 0.2 * (1.0 + y * (1.0 / 6.0) * e))
    e = 1.0 + y * (1.0 + y * 0.5 * (1.0 + y * (1.0 / 3.0) * e))
    e *= e
    e *= e
    e *= e
    e *= e
    e *= e
    return e * e


@sum_kernel
def _add_block(
    block: Matrix,
    count: int,
    sharpness: float,
    window_start: float,
    window_end: float,
    exact: float,
    terms: Vector,
) -> None:
    """Add the pairs in the first columns of a block (19, n).

    With `exact` 0 instead of 1 only the convex part of the Hessian, ``slope 2 L' B L``, is added.
    """
    span = window_end - window_start
    t0 = t1 = t2 = t3 = t4 = t5 = t6 = 0.0
    t7 = t8 = t9 = t10 = t11 = t12 = t13 = 0.0
    t14 = t15 = t16 = t17 = t18 = t19 = t20 = 0.0
    t21 = t22 = t23 = t24 = t25 = t26 = t27 = 0.0
    for p in range(count):
        y0, y1, y2 = block[0, p], block[1, p], block[2, p]
        q0, q1, q2 = block[3, p], block[4, p], block[5, p]
        c00, c01, c02 = block[6, p], block[7, p], block[8, p]
        c11, c12, c22 = block[9, p], block[10, p], block[11, p]
        s00, s01, s02 = block[12, p], block[13, p], block[14, p]
        s11, s12, s22 = block[15, p], block[16, p], block[17, p]
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
        squared = b0 * q0 + b1 * q1 + b2 * q2

        score = -block[18, p] * _decay(0.5 * sharpness * squared)
        slope = -0.5 * sharpness * score
        curve = -0.5 * sharpness * slope
        # Before the window falls v is 0, the window 1; from its end on v is 1, the window 0.
        # Its derivatives are 0 at both.
        v = min(1.0, max(0.0, (squared - window_start) / span))
        window = 1.0 - v * v * v * (10.0 - 15.0 * v + 6.0 * v * v)
        window_slope = -30.0 * v * v * (1.0 - v) * (1.0 - v) / span
        window_curve = -60.0 * v * (1.0 - v) * (1.0 - 2.0 * v) / (span * span)
        curve = curve * window + 2.0 * slope * window_slope + score * window_curve
        slope = slope * window + score * window_slope
        score *= window

        u0 = y0 - (c00 * b0 + c01 * b1 + c02 * b2)
        u1 = y1 - (c01 * b0 + c11 * b1 + c12 * b2)
        u2 = y2 - (c02 * b0 + c12 * b1 + c22 * b2)
        # D = C hat(b) and M = hat(u) + D.
        d00 = c01 * b2 - c02 * b1
        d01 = c02 * b0 - c00 * b2
        d02 = c00 * b1 - c01 * b0
        d10 = c11 * b2 - c12 * b1
        d11 = c12 * b0 - c01 * b2
        d12 = c01 * b1 - c11 * b0
        d20 = c12 * b2 - c22 * b1
        d21 = c22 * b0 - c02 * b2
        d22 = c02 * b1 - c12 * b0
        m01 = d01 - u2
        m02 = d02 + u1
        m10 = d10 + u2
        m12 = d12 - u0
        m20 = d20 - u1
        m21 = d21 + u0
        # N = B M; L' B L has the blocks B, -N and M' N.
        n00 = k00 * d00 + k01 * m10 + k02 * m20
        n01 = k00 * m01 + k01 * d11 + k02 * m21
        n02 = k00 * m02 + k01 * m12 + k02 * d22
        n10 = k01 * d00 + k11 * m10 + k12 * m20
        n11 = k01 * m01 + k11 * d11 + k12 * m21
        n12 = k01 * m02 + k11 * m12 + k12 * d22
        n20 = k02 * d00 + k12 * m10 + k22 * m20
        n21 = k02 * m01 + k12 * d11 + k22 * m21
        n22 = k02 * m02 + k12 * m12 + k22 * d22
        # Half the gradient of s is (b, g); half its Hessian's rotation block is h.
        g0 = u1 * b2 - u2 * b1
        g1 = u2 * b0 - u0 * b2
        g2 = u0 * b1 - u1 * b0
        dot = b0 * u0 + b1 * u1 + b2 * u2
        h00 = d00 * n00 + m10 * n10 + m20 * n20 + exact * (b0 * u0 - dot + b1 * d20 - b2 * d10)
        h11 = m01 * n01 + d11 * n11 + m21 * n21 + exact * (b1 * u1 - dot + b2 * d01 - b0 * d21)
        h22 = m02 * n02 + m12 * n12 + d22 * n22 + exact * (b2 * u2 - dot + b0 * d12 - b1 * d02)
        e01 = 0.5 * (b0 * u1 + b1 * u0) + b1 * d21 - b2 * d11
        e02 = 0.5 * (b0 * u2 + b2 * u0) + b1 * d22 - b2 * d12
        e12 = 0.5 * (b1 * u2 + b2 * u1) + b2 * d02 - b0 * d22
        h01 = d00 * n01 + m10 * n11 + m20 * n21 + exact * e01
        h02 = d00 * n02 + m10 * n12 + m20 * n22 + exact * e02
        h12 = m01 * n02 + d11 * n12 + m21 * n22 + exact * e12

        slope *= 2.0
        curve *= 4.0 * exact
        t0 += score
        t1 += slope * b0
        t2 += slope * b1
        t3 += slope * b2
        t4 += slope * g0
        t5 += slope * g1
        t6 += slope * g2
        t7 += slope * k00 + curve * b0 * b0
        t8 += slope * k01 + curve * b0 * b1
        t9 += slope * k02 + curve * b0 * b2
        t10 += curve * b0 * g0 - slope * n00
        t11 += curve * b0 * g1 - slope * n01
        t12 += curve * b0 * g2 - slope * n02
        t13 += slope * k11 + curve * b1 * b1
        t14 += slope * k12 + curve * b1 * b2
        t15 += curve * b1 * g0 - slope * n10
        t16 += curve * b1 * g1 - slope * n11
        t17 += curve * b1 * g2 - slope * n12
        t18 += slope * k22 + curve * b2 * b2
        t19 += curve * b2 * g0 - slope * n20
        t20 += curve * b2 * g1 - slope * n21
        t21 += curve * b2 * g2 - slope * n22
        t22 += slope * h00 + curve * g0 * g0
        t23 += slope * h01 + curve * g0 * g1
        t24 += slope * h02 + curve * g0 * g2
        t25 += slope * h11 + curve * g1 * g1
        t26 += slope * h12 + curve * g1 * g2
        t27 += slope * h22 + curve * g2 * g2

    terms[0] += t0
    terms[1] += t1
    terms[2] += t2
    terms[3] += t3
    terms[4] += t4
    terms[5] += t5
    terms[6] += t6
    terms[7] += t7
    terms[8] += t8
    terms[9] += t9
    terms[10] += t10
    terms[11] += t11
    terms[12] += t12
    terms[13] += t13
    terms[14] += t14
    terms[15] += t15
    terms[16] += t16
    terms[17] += t17
    terms[18] += t18
    terms[19] += t19
    terms[20] += t20
    terms[21] += t21
    terms[22] += t22
    terms[23] += t23
    terms[24] += t24
    terms[25] += t25
    terms[26] += t26
    terms[27] += t27


@sum_part
def _moved(
    points: Points, i: int, rotation: Matrix, translation: Vector
) -> tuple[float, float, float]:
    """Return a point in the target's frame."""
    x0, x1, x2 = points[i, 0], points[i, 1], points[i, 2]
    return (
        rotation[0, 0] * x0 + rotation[0, 1] * x1 + rotation[0, 2] * x2 + translation[0],
        rotation[1, 0] * x0 + rotation[1, 1] * x1 + rotation[1, 2] * x2 + translation[1],
        rotation[2, 0] * x0 + rotation[2, 1] * x1 + rotation[2, 2] * x2 + translation[2],
    )


@sum_part
def _turned(
    covariances: Matrix, i: int, rotation: Matrix
) -> tuple[float, float, float, float, float, float]:
    """Return the packed ``R C R'`` of a packed covariance."""
    r00, r01, r02 = rotation[0, 0], rotation[0, 1], rotation[0, 2]
    r10, r11, r12 = rotation[1, 0], rotation[1, 1], rotation[1, 2]
    r20, r21, r22 = rotation[2, 0], rotation[2, 1], rotation[2, 2]
    s0, s1, s2 = covariances[i, 0], covariances[i, 1], covariances[i, 2]
    s3, s4, s5 = covariances[i, 3], covariances[i, 4], covariances[i, 5]
    # First the half product R C.
    h00, h01 = r00 * s0 + r01 * s1 + r02 * s2, r00 * s1 + r01 * s3 + r02 * s4
    h02, h10 = r00 * s2 + r01 * s4 + r02 * s5, r10 * s0 + r11 * s1 + r12 * s2
    h11, h12 = r10 * s1 + r11 * s3 + r12 * s4, r10 * s2 + r11 * s4 + r12 * s5
    h20, h21 = r20 * s0 + r21 * s1 + r22 * s2, r20 * s1 + r21 * s3 + r22 * s4
    h22 = r20 * s2 + r21 * s4 + r22 * s5
    return (
        h00 * r00 + h01 * r01 + h02 * r02,
        h00 * r10 + h01 * r11 + h02 * r12,
        h00 * r20 + h01 * r21 + h02 * r22,
        h10 * r10 + h11 * r11 + h12 * r12,
        h10 * r20 + h11 * r21 + h12 * r22,
        h20 * r20 + h21 * r21 + h22 * r22,
    )


@sum_kernel
def d2d_terms(
    target_means: Points,
    target_covariances: Matrix,
    target_weights: Vector,
    source_means: Points,
    source_covariances: Matrix,
    source_weights: Vector,
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
    and none where that is -1. Covariances are (k, 6) packed upper triangles.
    """
    terms = np.zeros(28)
    block = np.empty((_PARTS, _ROW), np.float64)
    filled = 0
    for i in range(source_means.shape[0]):
        if lists[i] < 0:
            continue
        first, last = starts[lists[i]], starts[lists[i] + 1]
        if first == last:
            continue
        y0, y1, y2 = _moved(source_means, i, rotation, translation)
        c00, c01, c02, c11, c12, c22 = _turned(source_covariances, i, rotation)
        for m in range(first, last):
            j = np.uint64(members[m])
            p = np.uint64(filled)
            block[0, p], block[1, p], block[2, p] = y0, y1, y2
            block[3, p] = y0 - target_means[j, 0]
            block[4, p] = y1 - target_means[j, 1]
            block[5, p] = y2 - target_means[j, 2]
            block[6, p], block[7, p], block[8, p] = c00, c01, c02
            block[9, p], block[10, p], block[11, p] = c11, c12, c22
            block[12, p] = c00 + target_covariances[j, 0]
            block[13, p] = c01 + target_covariances[j, 1]
            block[14, p] = c02 + target_covariances[j, 2]
            block[15, p] = c11 + target_covariances[j, 3]
            block[16, p] = c12 + target_covariances[j, 4]
            block[17, p] = c22 + target_covariances[j, 5]
            block[18, p] = source_weights[i] * target_weights[j]
            filled += 1
            if filled == _BLOCK:
                _add_block(block, filled, sharpness, window_start, window_end, exact, terms)
                filled = 0
    _add_block(block, filled, sharpness, window_start, window_end, exact, terms)
    return terms
