"""D2D: sums of the scores of Gaussians against Gaussians, with their derivatives.

The score of a pair at squared Mahalanobis distance ``s`` is ``-w exp(-sharpness s / 2) W(s)``. The
window W falls from 1 at `window_start` to 0 at `window_end` with two continuous derivatives, so
the objective stays twice differentiable although pairs beyond the end are left out.

With ``y`` a mean of the source in the target's frame, ``C = R C_s R'`` its covariance there,
``q = y - mu``, ``B = (C + C_t)^-1``, ``b = B q`` and ``u = y - C b``, the squared distance
``s = q' B q`` has, for the step ``(rho, phi)``::

    gradient  2 (b, u x b)
    Hessian   2 L' B L + blkdiag(0, b u' + u b' - 2 (b.u) I + 2 hat(b) C hat(b))
    with      L = [I, -M],  M = hat(u) + C hat(b)

These are the derivatives of Stoyanov et al. 2012 for a left perturbation, including the rotation
of the covariance. The 28 terms are the value, the gradient (6) and the upper triangle of the
Hessian, row by row (21). With `exact` 0 instead of 1 the Hessian is its convex part, the
Gauss-Newton approximation.

Pairs are gathered in blocks, and all arithmetic is done in one loop over a block, without a branch
or a call: vector units then process eight pairs at once. Beyond the window the terms of a pair are
exactly zero, so superfluous pairs cost time and change no sum.
"""

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector
from scanlock.kernels._compile import inlined, kernel, sum_helper, sum_kernel
from scanlock.kernels._inline import (
    NO_TERMS,
    Nine,
    Symmetric,
    Triple,
    add_to,
    added,
    dot,
    inverse,
    nine,
    product,
    rotated,
    symmetric,
    transformed,
    triple,
    windowed_score,
)

_BLOCK = 256
"""Pairs in a block, few enough for the block to stay in the cache."""

_FIELDS = 19
"""Rows of a block: y (3), q (3), C (6), C + C_t (6) and the weight of each pair."""

_ROW = _BLOCK + 8
"""Length of a row. If it were a power of two, all rows would share few lines of the cache."""


@inlined
def _rotation_derivatives(
    y: Triple, c: Symmetric, k: Symmetric, b: Triple, exact: float
) -> tuple[Triple, Nine, Symmetric]:
    """Return half of the rotation part of the derivatives of s, with the precision K = B.

    The rotation part of the gradient (3), the block ``B M`` (9) and the rotation block of the
    Hessian (6).
    """
    c00, c01, c02, c11, c12, c22 = c
    k00, k01, k02, k11, k12, k22 = k
    b0, b1, b2 = b
    cb0, cb1, cb2 = product(c, b)
    u0, u1, u2 = y[0] - cb0, y[1] - cb1, y[2] - cb2
    # D = C hat(b) and M = hat(u) + D.
    d00, d01, d02 = c01 * b2 - c02 * b1, c02 * b0 - c00 * b2, c00 * b1 - c01 * b0
    d10, d11, d12 = c11 * b2 - c12 * b1, c12 * b0 - c01 * b2, c01 * b1 - c11 * b0
    d20, d21, d22 = c12 * b2 - c22 * b1, c22 * b0 - c02 * b2, c02 * b1 - c12 * b0
    m01, m02, m10 = d01 - u2, d02 + u1, d10 + u2
    m12, m20, m21 = d12 - u0, d20 - u1, d21 + u0
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
    g = u1 * b2 - u2 * b1, u2 * b0 - u0 * b2, u0 * b1 - u1 * b0
    bu = b0 * u0 + b1 * u1 + b2 * u2
    h00 = d00 * n00 + m10 * n10 + m20 * n20 + exact * (b0 * u0 - bu + b1 * d20 - b2 * d10)
    h11 = m01 * n01 + d11 * n11 + m21 * n21 + exact * (b1 * u1 - bu + b2 * d01 - b0 * d21)
    h22 = m02 * n02 + m12 * n12 + d22 * n22 + exact * (b2 * u2 - bu + b0 * d12 - b1 * d02)
    e01 = 0.5 * (b0 * u1 + b1 * u0) + b1 * d21 - b2 * d11
    e02 = 0.5 * (b0 * u2 + b2 * u0) + b1 * d22 - b2 * d12
    e12 = 0.5 * (b1 * u2 + b2 * u1) + b2 * d02 - b0 * d22
    h01 = d00 * n01 + m10 * n11 + m20 * n21 + exact * e01
    h02 = d00 * n02 + m10 * n12 + m20 * n22 + exact * e02
    h12 = m01 * n02 + d11 * n12 + m21 * n22 + exact * e12
    return g, (n00, n01, n02, n10, n11, n12, n20, n21, n22), (h00, h01, h02, h11, h12, h22)


@sum_helper
def _add_block(
    block: Matrix,
    count: int,
    sharpness: float,
    window_start: float,
    window_end: float,
    exact: float,
    terms: Vector,
) -> None:
    """Add the terms of the pairs in the first columns of a block (19, n) to the 28 sums.

    With `exact` 0 instead of 1 only the convex part of the Hessian, ``slope 2 L' B L``, is added.
    """
    span = window_end - window_start
    limits = window_start, 1.0 / span, 1.0 / (span * span)
    sums = NO_TERMS
    for p in range(count):
        y = block[0, p], block[1, p], block[2, p]
        q = block[3, p], block[4, p], block[5, p]
        c = block[6, p], block[7, p], block[8, p], block[9, p], block[10, p], block[11, p]
        s = block[12, p], block[13, p], block[14, p], block[15, p], block[16, p], block[17, p]
        k = inverse(s)
        b = product(k, q)
        score, slope, curve = windowed_score(block[18, p], dot(b, q), sharpness, limits)
        g, n, h = _rotation_derivatives(y, c, k, b, exact)
        k00, k01, k02, k11, k12, k22 = k
        b0, b1, b2 = b
        g0, g1, g2 = g
        n00, n01, n02, n10, n11, n12, n20, n21, n22 = n
        h00, h01, h02, h11, h12, h22 = h
        slope *= 2.0
        curve *= 4.0 * exact
        sums = added(
            sums,
            (
                score,
                slope * b0, slope * b1, slope * b2, slope * g0, slope * g1, slope * g2,
                slope * k00 + curve * b0 * b0,
                slope * k01 + curve * b0 * b1,
                slope * k02 + curve * b0 * b2,
                curve * b0 * g0 - slope * n00,
                curve * b0 * g1 - slope * n01,
                curve * b0 * g2 - slope * n02,
                slope * k11 + curve * b1 * b1,
                slope * k12 + curve * b1 * b2,
                curve * b1 * g0 - slope * n10,
                curve * b1 * g1 - slope * n11,
                curve * b1 * g2 - slope * n12,
                slope * k22 + curve * b2 * b2,
                curve * b2 * g0 - slope * n20,
                curve * b2 * g1 - slope * n21,
                curve * b2 * g2 - slope * n22,
                slope * h00 + curve * g0 * g0,
                slope * h01 + curve * g0 * g1,
                slope * h02 + curve * g0 * g2,
                slope * h11 + curve * g1 * g1,
                slope * h12 + curve * g1 * g2,
                slope * h22 + curve * g2 * g2,
            ),
        )  # fmt: skip
    add_to(terms, sums)


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
    """Return the 28 sums over pairs of Gaussians, each weighted by the product of its weights.

    Parameters
    ----------
    target_means, source_means : (k, 3), (m, 3) [m]
    target_covariances, source_covariances : (k, 6), (m, 6) [m^2]
        Packed upper triangles.
    target_weights, source_weights : (k,), (m,)
    lists : (m,)
        Neighbour list of each source Gaussian; -1 for none.
    starts, members
        List l holds the rows ``members[starts[l] : starts[l + 1]]`` of the target.
    rotation, translation : (3, 3), (3,) [m]
        Pose of the source in the target's frame.
    sharpness, window_start, window_end : float
    exact : float
        1 for the exact Hessian, 0 for its convex part.
    """
    terms = np.zeros(28)
    block = np.empty((_FIELDS, _ROW), np.float64)
    filled = 0
    for i in range(source_means.shape[0]):
        if lists[i] < 0:
            continue
        first, last = starts[lists[i]], starts[lists[i] + 1]
        if first == last:
            continue
        r, t = nine(rotation), triple(translation)
        y0, y1, y2 = transformed(r, t, source_means[i, 0], source_means[i, 1], source_means[i, 2])
        c00, c01, c02, c11, c12, c22 = rotated(r, symmetric(source_covariances, i))
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


@kernel
def d2d_terms_by_run(
    target_means: Points,
    target_covariances: Matrix,
    target_weights: Vector,
    source_means: Points,
    source_covariances: Matrix,
    source_weights: Vector,
    lists: Labels,
    starts: Labels,
    members: Labels,
    ends: Labels,
    rotation: Matrix,
    translation: Vector,
    sharpness: float,
    window_start: float,
    window_end: float,
    exact: float,
) -> Matrix:
    """Return the (r, 28) sums of `d2d_terms` of consecutive runs of sources with the given ends."""
    terms = np.empty((ends.shape[0], 28))
    first = 0
    for run in range(ends.shape[0]):
        last = ends[run]
        sums = d2d_terms(
            target_means,
            target_covariances,
            target_weights,
            source_means[first:last],
            source_covariances[first:last],
            source_weights[first:last],
            lists[first:last],
            starts,
            members,
            rotation,
            translation,
            sharpness,
            window_start,
            window_end,
            exact,
        )
        for term in range(28):
            terms[run, term] = sums[term]
        first = last
    return terms
