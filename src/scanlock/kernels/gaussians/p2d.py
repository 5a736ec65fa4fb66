"""P2D: sums of the scores of points against Gaussians, with their derivatives.

This is the sum over all Gaussians in range; `cells` has the score of the own or neighbouring cells.

Score and window of a pair are those of `kernels/gaussians/d2d.py`. With ``y`` a point of the
source in the target's frame, ``q = y - mu``, ``B`` the inverse of the Gaussian's covariance and
``b = B q``, the squared distance ``s = q' B q`` has, for the step ``(rho, phi)``::

    gradient  2 (b, y x b)
    Hessian   2 L' B L + blkdiag(0, b y' + y b' - 2 (b.y) I)    with  L = [I, -hat(y)]

These are the derivatives of Magnusson 2009, section 6.2.1, for a left perturbation. The pair enters
only by b and B, so they are summed over the Gaussians of a point first, and the lever arm y enters
once per point. The 28 terms are the value, the gradient (6) and the upper triangle of the Hessian,
row by row (21). With `exact` 0 instead of 1 the Hessian is its convex part, the Gauss-Newton
approximation.

Vector units process eight points at once, so points come in blocks of neighbours: a Gaussian is
evaluated for all points of a block or for none.
"""

import math

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector
from scanlock.kernels._compile import helper, kernel, sum_helper
from scanlock.kernels._inline import (
    NO_TERMS,
    add_to,
    added,
    product,
    quadratic_form,
    windowed_score,
)

_BLOCK = 32
"""Points in a block: few, so that blocks are small in space, yet enough to fill vector units."""

_GROUP = 8
"""Blocks that share a first selection of Gaussians."""

_ROW = _BLOCK + 8
"""Length of a row. If it were a power of two, all rows would share few lines of the cache."""


@sum_helper
def _add_gaussians(
    positions: Matrix,
    sums: Matrix,
    count: int,
    gaussians: Matrix,
    rows: Labels,
    row_count: int,
    sharpness: float,
    window_start: float,
    window_end: float,
    exact: float,
) -> None:
    """Add the scores of a block of points under the first `row_count` of some Gaussians.

    The sums (10, n) of each point are its score, its slope times b (3), and its slope times B plus
    its curve times ``b b'`` (6). Gaussians with no point of the block in their window are skipped.
    """
    # One function with the loop over Gaussians inside: otherwise the checks that arrays do not
    # overlap, which precede a loop in vector units, would be repeated for each Gaussian.
    per_span = 1.0 / (window_end - window_start)
    limits = window_start, per_span, per_span * per_span
    for m in range(row_count):
        j = rows[m]
        mu0, mu1, mu2 = gaussians[j, 0], gaussians[j, 1], gaussians[j, 2]
        k00, k01, k02 = gaussians[j, 3], gaussians[j, 4], gaussians[j, 5]
        k11, k12, k22 = gaussians[j, 6], gaussians[j, 7], gaussians[j, 8]
        k = k00, k01, k02, k11, k12, k22
        within = 0.0
        for p in range(count):
            q0, q1, q2 = positions[0, p] - mu0, positions[1, p] - mu1, positions[2, p] - mu2
            squared = quadratic_form(k, (q0, q1, q2))
            within += 1.0 if squared < window_end else 0.0
        if within == 0.0:
            continue
        for p in range(count):
            q0, q1, q2 = positions[0, p] - mu0, positions[1, p] - mu1, positions[2, p] - mu2
            b0, b1, b2 = product(k, (q0, q1, q2))
            squared = b0 * q0 + b1 * q1 + b2 * q2
            score, slope, curve = windowed_score(1.0, squared, sharpness, limits)
            slope *= 2.0
            curve *= 4.0 * exact
            v0, v1, v2 = curve * b0, curve * b1, curve * b2
            sums[0, p] += score
            sums[1, p] += slope * b0
            sums[2, p] += slope * b1
            sums[3, p] += slope * b2
            sums[4, p] += slope * k00 + v0 * b0
            sums[5, p] += slope * k01 + v0 * b1
            sums[6, p] += slope * k02 + v0 * b2
            sums[7, p] += slope * k11 + v1 * b1
            sums[8, p] += slope * k12 + v1 * b2
            sums[9, p] += slope * k22 + v2 * b2


@sum_helper
def _add_block(positions: Matrix, sums: Matrix, count: int, exact: float, terms: Vector) -> None:
    """Add the 28 terms of the points of a block, given their sums f, g and H (10, n).

    As `add_point_terms`, in a form that the loop can vectorise.
    """
    total = NO_TERMS
    for p in range(count):
        y0, y1, y2 = positions[0, p], positions[1, p], positions[2, p]
        g0, g1, g2 = sums[1, p], sums[2, p], sums[3, p]
        h00, h01, h02 = sums[4, p], sums[5, p], sums[6, p]
        h11, h12, h22 = sums[7, p], sums[8, p], sums[9, p]
        # N = H hat(y); J' H J has the blocks H, -N and hat(y)' N.
        n00, n01, n02 = h01 * y2 - h02 * y1, h02 * y0 - h00 * y2, h00 * y1 - h01 * y0
        n10, n11, n12 = h11 * y2 - h12 * y1, h12 * y0 - h01 * y2, h01 * y1 - h11 * y0
        n20, n21, n22 = h12 * y2 - h22 * y1, h22 * y0 - h02 * y2, h02 * y1 - h12 * y0
        half0, half1, half2 = 0.5 * exact * g0, 0.5 * exact * g1, 0.5 * exact * g2
        total = added(
            total,
            (
                sums[0, p], g0, g1, g2, y1 * g2 - y2 * g1, y2 * g0 - y0 * g2, y0 * g1 - y1 * g0,
                h00, h01, h02, -n00, -n01, -n02,
                h11, h12, -n10, -n11, -n12,
                h22, -n20, -n21, -n22,
                y2 * n10 - y1 * n20 - 2.0 * (half1 * y1 + half2 * y2),
                y2 * n11 - y1 * n21 + half0 * y1 + half1 * y0,
                y2 * n12 - y1 * n22 + half0 * y2 + half2 * y0,
                y0 * n21 - y2 * n01 - 2.0 * (half0 * y0 + half2 * y2),
                y0 * n22 - y2 * n02 + half1 * y2 + half2 * y1,
                y1 * n02 - y0 * n12 - 2.0 * (half0 * y0 + half1 * y1),
            ),
        )  # fmt: skip
    add_to(terms, total)


@kernel
def bounding_balls(points: Points) -> Matrix:
    """Return (g, 4) centres and radii [m] of balls around the blocks of (n, 3) points."""
    count = points.shape[0]
    balls = np.zeros(((count + _BLOCK - 1) // _BLOCK, 4), np.float64)
    for g in range(balls.shape[0]):
        first, last = g * _BLOCK, min((g + 1) * _BLOCK, count)
        for p in range(first, last):
            for a in range(3):
                balls[g, a] += points[p, a] / (last - first)
        squared = 0.0
        for p in range(first, last):
            d0, d1 = points[p, 0] - balls[g, 0], points[p, 1] - balls[g, 1]
            d2 = points[p, 2] - balls[g, 2]
            squared = max(squared, d0 * d0 + d1 * d1 + d2 * d2)
        balls[g, 3] = math.sqrt(squared)
    return balls


@helper
def _transform_block(
    points: Points, first: int, last: int, rotation: Matrix, translation: Vector, positions: Matrix
) -> None:
    """Write the points of a block, in the target's frame, to the columns of `positions`."""
    for a in range(3):
        ra0, ra1, ra2, ta = rotation[a, 0], rotation[a, 1], rotation[a, 2], translation[a]
        for p in range(first, last):
            x, y, z = points[p, 0], points[p, 1], points[p, 2]
            positions[a, p - first] = ra0 * x + ra1 * y + ra2 * z + ta


@helper
def _ball_around(balls: Matrix, first: int, last: int) -> tuple[float, float, float, float]:
    """Return the centre and radius of a ball around balls."""
    x = y = z = radius = 0.0
    for g in range(first, last):
        x += balls[g, 0] / (last - first)
        y += balls[g, 1] / (last - first)
        z += balls[g, 2] / (last - first)
    for g in range(first, last):
        d0, d1, d2 = balls[g, 0] - x, balls[g, 1] - y, balls[g, 2] - z
        radius = max(radius, math.sqrt(d0 * d0 + d1 * d1 + d2 * d2) + balls[g, 3])
    return x, y, z, radius


@helper
def _select(
    gaussians: Matrix,
    rows: Labels,
    row_count: int,
    x: float,
    y: float,
    z: float,
    radius: float,
    selected: Labels,
) -> int:
    """Write the Gaussians, of the first `row_count` rows, that can score in a ball; count them."""
    count = 0
    for m in range(row_count):
        j = rows[m]
        d0, d1, d2 = gaussians[j, 0] - x, gaussians[j, 1] - y, gaussians[j, 2] - z
        max_distance = gaussians[j, 9] + radius
        # Always written, kept only where it can score: no branch to predict.
        selected[count] = j
        count += d0 * d0 + d1 * d1 + d2 * d2 < max_distance * max_distance
    return count


@kernel
def p2d_terms(
    points: Points,
    balls: Matrix,
    gaussians: Matrix,
    rotation: Matrix,
    translation: Vector,
    sharpness: float,
    window_start: float,
    window_end: float,
    exact: float,
) -> Vector:
    """Return the 28 sums over all points and all Gaussians, unweighted.

    Points may come in any order; it is fastest where neighbours in the order are close in space.

    Parameters
    ----------
    points : (n, 3) [m]
        Of the source.
    balls : (g, 4) [m]
        Those of `bounding_balls`.
    gaussians : (k, 10)
        Mean [m], packed inverse covariance [m^-2], and the distance [m] beyond which the Gaussian
        scores nothing.
    rotation, translation : (3, 3), (3,) [m]
        Pose of the source in the target's frame.
    sharpness, window_start, window_end : float
    exact : float
        1 for the exact Hessian, 0 for its convex part.
    """
    terms = np.zeros(28, np.float64)
    positions, sums = np.zeros((3, _ROW), np.float64), np.zeros((10, _ROW), np.float64)
    moved = np.empty((balls.shape[0], 4), np.float64)
    for g in range(balls.shape[0]):
        x, y, z = balls[g, 0], balls[g, 1], balls[g, 2]
        for a in range(3):
            moved[g, a] = rotation[a, 0] * x + rotation[a, 1] * y + rotation[a, 2] * z
            moved[g, a] += translation[a]
        moved[g, 3] = balls[g, 3]
    count = gaussians.shape[0]
    # One more entry, for a last Gaussian that is written but not kept.
    of_group, of_block = np.empty(count + 1, np.int64), np.empty(count + 1, np.int64)
    all_rows = np.arange(count)
    for begin in range(0, balls.shape[0], _GROUP):
        end = min(begin + _GROUP, balls.shape[0])
        x, y, z, radius = _ball_around(moved, begin, end)
        group_count = _select(gaussians, all_rows, count, x, y, z, radius, of_group)
        for g in range(begin, end):
            x, y, z, radius = moved[g, 0], moved[g, 1], moved[g, 2], moved[g, 3]
            block_count = _select(gaussians, of_group, group_count, x, y, z, radius, of_block)
            if block_count == 0:
                continue
            first, last = g * _BLOCK, min((g + 1) * _BLOCK, points.shape[0])
            _transform_block(points, first, last, rotation, translation, positions)
            sums[:] = 0.0
            _add_gaussians(
                positions, sums, last - first, gaussians, of_block, block_count,
                sharpness, window_start, window_end, exact,
            )  # fmt: skip
            _add_block(positions, sums, last - first, exact, terms)
    return terms
