"""P2D: sums of the scores of points against Gaussians, with their derivatives.

Score and window of a pair are those of `kernels/gaussians/d2d.py`. With ``y`` a point of the
source in the target's frame, ``q = y - mu``, ``B`` the inverse of the Gaussian's covariance and
``b = B q``, the squared distance ``s = q' B q`` has, for the step ``(rho, phi)``::

    gradient  2 (b, y x b)
    Hessian   2 L' B L + blkdiag(0, b y' + y b' - 2 (b.y) I)    with  L = [I, -hat(y)]

which is Magnusson 2009, section 6.2.1, in a left perturbation. Of the pair only b and B enter, so
a point sums these over its Gaussians, and meets its lever arm y once. The 28 sums are the value,
the gradient (6) and the upper triangle of the Hessian, row by row (21); with `exact` 0 instead of
1 the Hessian is its convex part, that of Gauss and Newton.

Vector units take eight points at once, so points come in blocks of neighbours: a Gaussian meets
all points of a block or is left out for all of them.
"""

import math

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector
from scanlock.kernels._compile import kernel, sum_kernel, sum_part

_BLOCK = 32
"""Few, so that a block is hardly wider than what reaches it; many, to fill the vector units."""

_TOGETHER = 8
"""Blocks that share a first look at which Gaussians can reach them."""

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
def _meet(
    places: Matrix,
    sums: Matrix,
    count: int,
    gaussians: Matrix,
    rows: Labels,
    few: int,
    sharpness: float,
    window_start: float,
    window_end: float,
    exact: float,
) -> None:
    """Add the first rows of Gaussians, as far as points of a block lie within their windows.

    The sums (10, n) of each point are its score, its slope by b (3) and by B with the curve (6).
    """
    # In one function with the loop over Gaussians, or the checks that arrays do not overlap,
    # which come before a loop in vector units, would be made for each Gaussian anew.
    span = 1.0 / (window_end - window_start)
    for m in range(few):
        j = rows[m]
        mu0, mu1, mu2 = gaussians[j, 0], gaussians[j, 1], gaussians[j, 2]
        k00, k01, k02 = gaussians[j, 3], gaussians[j, 4], gaussians[j, 5]
        k11, k12, k22 = gaussians[j, 6], gaussians[j, 7], gaussians[j, 8]
        within = 0.0
        for p in range(count):
            q0, q1, q2 = places[0, p] - mu0, places[1, p] - mu1, places[2, p] - mu2
            squared = q0 * (k00 * q0 + 2.0 * (k01 * q1 + k02 * q2))
            squared += q1 * (k11 * q1 + 2.0 * k12 * q2) + k22 * q2 * q2
            within += 1.0 if squared < window_end else 0.0
        if within == 0.0:
            continue
        for p in range(count):
            q0, q1, q2 = places[0, p] - mu0, places[1, p] - mu1, places[2, p] - mu2
            b0 = k00 * q0 + k01 * q1 + k02 * q2
            b1 = k01 * q0 + k11 * q1 + k12 * q2
            b2 = k02 * q0 + k12 * q1 + k22 * q2
            squared = b0 * q0 + b1 * q1 + b2 * q2
            score = -_decay(0.5 * sharpness * squared)
            slope = -0.5 * sharpness * score
            curve = -0.5 * sharpness * slope
            # Before the window falls v is 0, the window 1; from its end on v is 1, the window 0.
            # Its derivatives are 0 at both.
            v = min(1.0, max(0.0, (squared - window_start) * span))
            window = 1.0 - v * v * v * (10.0 - 15.0 * v + 6.0 * v * v)
            first = -30.0 * v * v * (1.0 - v) * (1.0 - v) * span
            second = -60.0 * v * (1.0 - v) * (1.0 - 2.0 * v) * span * span
            curve = 4.0 * exact * (curve * window + 2.0 * slope * first + score * second)
            slope = 2.0 * (slope * window + score * first)
            v0, v1, v2 = curve * b0, curve * b1, curve * b2
            sums[0, p] += score * window
            sums[1, p] += slope * b0
            sums[2, p] += slope * b1
            sums[3, p] += slope * b2
            sums[4, p] += slope * k00 + v0 * b0
            sums[5, p] += slope * k01 + v0 * b1
            sums[6, p] += slope * k02 + v0 * b2
            sums[7, p] += slope * k11 + v1 * b1
            sums[8, p] += slope * k12 + v1 * b2
            sums[9, p] += slope * k22 + v2 * b2


@sum_kernel
def _add_block(places: Matrix, sums: Matrix, count: int, exact: float, terms: Vector) -> None:
    """Add the sums of a block's points, each with its lever arm, to the 28 sums."""
    t0 = t1 = t2 = t3 = t4 = t5 = t6 = 0.0
    t7 = t8 = t9 = t10 = t11 = t12 = t13 = 0.0
    t14 = t15 = t16 = t17 = t18 = t19 = t20 = 0.0
    t21 = t22 = t23 = t24 = t25 = t26 = t27 = 0.0
    for p in range(count):
        y0, y1, y2 = places[0, p], places[1, p], places[2, p]
        g0, g1, g2 = sums[1, p], sums[2, p], sums[3, p]
        k00, k01, k02 = sums[4, p], sums[5, p], sums[6, p]
        k11, k12, k22 = sums[7, p], sums[8, p], sums[9, p]
        t0 += sums[0, p]
        t1 += g0
        t2 += g1
        t3 += g2
        t4 += y1 * g2 - y2 * g1
        t5 += y2 * g0 - y0 * g2
        t6 += y0 * g1 - y1 * g0
        # N = K hat(y); L' K L has the blocks K, -N and hat(y)' N.
        n00, n01, n02 = k01 * y2 - k02 * y1, k02 * y0 - k00 * y2, k00 * y1 - k01 * y0
        n10, n11, n12 = k11 * y2 - k12 * y1, k12 * y0 - k01 * y2, k01 * y1 - k11 * y0
        n20, n21, n22 = k12 * y2 - k22 * y1, k22 * y0 - k02 * y2, k02 * y1 - k12 * y0
        t7 += k00
        t8 += k01
        t9 += k02
        t10 -= n00
        t11 -= n01
        t12 -= n02
        t13 += k11
        t14 += k12
        t15 -= n10
        t16 -= n11
        t17 -= n12
        t18 += k22
        t19 -= n20
        t20 -= n21
        t21 -= n22
        h0, h1, h2 = 0.5 * exact * g0, 0.5 * exact * g1, 0.5 * exact * g2
        t22 += y2 * n10 - y1 * n20 - 2.0 * (h1 * y1 + h2 * y2)
        t23 += y2 * n11 - y1 * n21 + h0 * y1 + h1 * y0
        t24 += y2 * n12 - y1 * n22 + h0 * y2 + h2 * y0
        t25 += y0 * n21 - y2 * n01 - 2.0 * (h0 * y0 + h2 * y2)
        t26 += y0 * n22 - y2 * n02 + h1 * y2 + h2 * y1
        t27 += y1 * n02 - y0 * n12 - 2.0 * (h0 * y0 + h1 * y1)
    terms += np.array(
        [
            t0, t1, t2, t3, t4, t5, t6, t7, t8, t9, t10, t11, t12, t13,
            t14, t15, t16, t17, t18, t19, t20, t21, t22, t23, t24, t25, t26, t27,
        ]
    )  # fmt: skip


@kernel
def point_balls(points: Points) -> Matrix:
    """Return a ball around each block of points: rows (4) of centre and radius."""
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


@kernel
def _move(
    points: Points, first: int, last: int, rotation: Matrix, translation: Vector, places: Matrix
) -> None:
    """Write points, in the target's frame, to the columns of `places`."""
    for a in range(3):
        ra0, ra1, ra2, ta = rotation[a, 0], rotation[a, 1], rotation[a, 2], translation[a]
        for p in range(first, last):
            places[a, p - first] = ra0 * points[p, 0] + ra1 * points[p, 1] + ra2 * points[p, 2] + ta


@kernel
def _around(balls: Matrix, first: int, last: int) -> tuple[float, float, float, float]:
    """Return a ball around balls: its centre and radius."""
    x = y = z = radius = 0.0
    for g in range(first, last):
        x += balls[g, 0] / (last - first)
        y += balls[g, 1] / (last - first)
        z += balls[g, 2] / (last - first)
    for g in range(first, last):
        d0, d1, d2 = balls[g, 0] - x, balls[g, 1] - y, balls[g, 2] - z
        radius = max(radius, math.sqrt(d0 * d0 + d1 * d1 + d2 * d2) + balls[g, 3])
    return x, y, z, radius


@kernel
def _reaching(
    gaussians: Matrix,
    among: Labels,
    count: int,
    x: float,
    y: float,
    z: float,
    radius: float,
    found: Labels,
) -> int:
    """List which of some Gaussians reach into a ball; return how many."""
    filled = 0
    for m in range(count):
        j = among[m]
        d0, d1, d2 = gaussians[j, 0] - x, gaussians[j, 1] - y, gaussians[j, 2] - z
        reach = gaussians[j, 9] + radius
        # Written every time and kept only where it reaches: no branch to guess.
        found[filled] = j
        filled += d0 * d0 + d1 * d1 + d2 * d2 < reach * reach
    return filled


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

    Points may come in any order; the closer together neighbours in it lie, the faster. Their
    `balls` (g, 4) are those of `point_balls`. A row of `gaussians` (k, 10) holds the mean, the
    packed inverse of the covariance, and the distance from which nothing can score.
    """
    terms = np.zeros(28, np.float64)
    places, sums = np.zeros((3, _ROW), np.float64), np.zeros((10, _ROW), np.float64)
    moved = np.empty((balls.shape[0], 4), np.float64)
    for g in range(balls.shape[0]):
        x, y, z = balls[g, 0], balls[g, 1], balls[g, 2]
        for a in range(3):
            moved[g, a] = rotation[a, 0] * x + rotation[a, 1] * y + rotation[a, 2] * z
            moved[g, a] += translation[a]
        moved[g, 3] = balls[g, 3]
    count = gaussians.shape[0]
    # One place more, for the last that does not reach.
    near, nearer = np.empty(count + 1, np.int64), np.empty(count + 1, np.int64)
    every = np.arange(count)
    for begin in range(0, balls.shape[0], _TOGETHER):
        end = min(begin + _TOGETHER, balls.shape[0])
        x, y, z, radius = _around(moved, begin, end)
        some = _reaching(gaussians, every, count, x, y, z, radius, near)
        for g in range(begin, end):
            x, y, z, radius = moved[g, 0], moved[g, 1], moved[g, 2], moved[g, 3]
            few = _reaching(gaussians, near, some, x, y, z, radius, nearer)
            if few == 0:
                continue
            first, last = g * _BLOCK, min((g + 1) * _BLOCK, points.shape[0])
            _move(points, first, last, rotation, translation, places)
            sums[:] = 0.0
            _meet(
                places, sums, last - first, gaussians, nearer, few,
                sharpness, window_start, window_end, exact,
            )  # fmt: skip
            _add_block(places, sums, last - first, exact, terms)
    return terms
