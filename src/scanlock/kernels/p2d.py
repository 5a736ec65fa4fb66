"""P2D: sums of the scores of points against Gaussians, with their derivatives.

The score of a pair at squared Mahalanobis distance ``s`` is ``-w exp(-sharpness s / 2) W(s)``,
with a window W that falls from 1 at `window_start` to 0 at `window_end` with two continuous
derivatives, so that leaving out pairs beyond the end changes nothing a solver can see.

With ``y`` a mean or point of the source in the target's frame, ``C = R C_s R'`` its covariance
there (0 for a point), ``q = y - mu``, ``B = (C + C_t)^-1``, ``b = B q`` and ``u = y - C b``, the
squared distance ``s = q' B q`` has, for the step ``(rho, phi)``::

    gradient  2 (b, u x b)
    Hessian   2 L' B L + blkdiag(0, b u' + u b' - 2 (b.u) I + 2 hat(b) C hat(b))
    with      L = [I, -M],  M = hat(u) + C hat(b)

which is Stoyanov et al. 2012 in a left perturbation, the turning covariance included, and for
``C = 0`` Magnusson 2009, section 6.2.1. Every kernel returns 28 sums: the value, the gradient (6)
and the upper triangle of the Hessian, row by row (21); with `exact` 0 instead of 1 the
Hessian is its convex part, that of Gauss and Newton.
"""

import math

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector
from scanlock.kernels._compile import sum_kernel, sum_part


@sum_part
def _score(
    squared: float, weight: float, sharpness: float, window_start: float, window_end: float
) -> tuple[float, float, float]:
    """Return the score of a pair and its first two derivatives in the squared distance."""
    score = -weight * math.exp(-0.5 * sharpness * squared)
    slope = -0.5 * sharpness * score
    curve = -0.5 * sharpness * slope
    if squared <= window_start:
        return score, slope, curve
    span = window_end - window_start
    v = (squared - window_start) / span
    window = 1.0 - v * v * v * (10.0 - 15.0 * v + 6.0 * v * v)
    window_slope = -30.0 * v * v * (1.0 - v) * (1.0 - v) / span
    window_curve = -60.0 * v * (1.0 - v) * (1.0 - 2.0 * v) / (span * span)
    return (
        score * window,
        slope * window + score * window_slope,
        curve * window + 2.0 * slope * window_slope + score * window_curve,
    )


@sum_part
def _add_pair(
    terms: Vector,
    score: float,
    slope: float,
    curve: float,
    b0: float,
    b1: float,
    b2: float,
    u0: float,
    u1: float,
    u2: float,
    k00: float,
    k01: float,
    k02: float,
    k11: float,
    k12: float,
    k22: float,
    c00: float,
    c01: float,
    c02: float,
    c11: float,
    c12: float,
    c22: float,
    exact: float,
) -> None:
    """Add one pair: ``b``, ``u``, the precision B as k and the source covariance C as c.

    With `exact` 0 instead of 1 only the convex part of the Hessian, ``slope 2 L' B L``, is added.
    """
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
    terms[0] += score
    terms[1] += slope * b0
    terms[2] += slope * b1
    terms[3] += slope * b2
    terms[4] += slope * g0
    terms[5] += slope * g1
    terms[6] += slope * g2
    terms[7] += slope * k00 + curve * b0 * b0
    terms[8] += slope * k01 + curve * b0 * b1
    terms[9] += slope * k02 + curve * b0 * b2
    terms[10] += curve * b0 * g0 - slope * n00
    terms[11] += curve * b0 * g1 - slope * n01
    terms[12] += curve * b0 * g2 - slope * n02
    terms[13] += slope * k11 + curve * b1 * b1
    terms[14] += slope * k12 + curve * b1 * b2
    terms[15] += curve * b1 * g0 - slope * n10
    terms[16] += curve * b1 * g1 - slope * n11
    terms[17] += curve * b1 * g2 - slope * n12
    terms[18] += slope * k22 + curve * b2 * b2
    terms[19] += curve * b2 * g0 - slope * n20
    terms[20] += curve * b2 * g1 - slope * n21
    terms[21] += curve * b2 * g2 - slope * n22
    terms[22] += slope * h00 + curve * g0 * g0
    terms[23] += slope * h01 + curve * g0 * g1
    terms[24] += slope * h02 + curve * g0 * g2
    terms[25] += slope * h11 + curve * g1 * g1
    terms[26] += slope * h12 + curve * g1 * g2
    terms[27] += slope * h22 + curve * g2 * g2


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


@sum_kernel
def p2d_terms(
    points: Points,
    means: Points,
    precisions: Matrix,
    starts: Labels,
    members: Labels,
    corner: Vector,
    width: float,
    columns: int,
    rows: int,
    rotation: Matrix,
    translation: Vector,
    sharpness: float,
    window_start: float,
    window_end: float,
    exact: float,
) -> Vector:
    """Return the 28 sums over all points and all Gaussians that can meet them, unweighted.

    `precisions` (k, 6) are packed inverses of the covariances; `starts` and `members` are the
    lists of `tile_lists`, so a point outside all tiles meets nothing.
    """
    terms = np.zeros(28)
    for i in range(points.shape[0]):
        y0, y1, y2 = _moved(points, i, rotation, translation)
        column = math.floor((y0 - corner[0]) / width)
        row = math.floor((y1 - corner[1]) / width)
        if column < 0 or column >= columns or row < 0 or row >= rows:
            continue
        tile = row * columns + column
        for m in range(starts[tile], starts[tile + 1]):
            j = members[m]
            q0, q1, q2 = y0 - means[j, 0], y1 - means[j, 1], y2 - means[j, 2]
            k00, k01, k02 = precisions[j, 0], precisions[j, 1], precisions[j, 2]
            k11, k12, k22 = precisions[j, 3], precisions[j, 4], precisions[j, 5]
            b0 = k00 * q0 + k01 * q1 + k02 * q2
            b1 = k01 * q0 + k11 * q1 + k12 * q2
            b2 = k02 * q0 + k12 * q1 + k22 * q2
            squared = b0 * q0 + b1 * q1 + b2 * q2
            if squared >= window_end:
                continue
            score, slope, curve = _score(squared, 1.0, sharpness, window_start, window_end)
            _add_pair(
                terms, score, slope, curve, b0, b1, b2, y0, y1, y2,
                k00, k01, k02, k11, k12, k22, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, exact,
            )  # fmt: skip
    return terms
