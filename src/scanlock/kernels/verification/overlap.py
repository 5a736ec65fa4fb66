"""How well two sets of Gaussians lie on each other: which of them meet, and their score."""

import math

import numpy as np

from scanlock.arrays import Labels, Mask, Matrix, Points, Vector
from scanlock.kernels._compile import kernel, sum_kernel

_BLOCK = 256
"""Pairs gathered at a time: loops over them, without a branch or a call, use vector units."""

_PARTS = 10
"""Rows of a block: the gap of the means (3), the sum of the covariances (6), the weight."""

_ROW = _BLOCK + 8
"""Length of a row. Were it a power of two, all rows would compete for few places in the cache."""


@sum_kernel
def _add_block(
    block: Matrix, count: int, window_start: float, window_end: float, squared: Vector
) -> float:
    """Return the score of the pairs in the first columns of a block; write their distances."""
    span = window_end - window_start
    score = 0.0
    for p in range(count):
        q0, q1, q2 = block[0, p], block[1, p], block[2, p]
        s00, s01, s02 = block[3, p], block[4, p], block[5, p]
        s11, s12, s22 = block[6, p], block[7, p], block[8, p]
        a00 = s11 * s22 - s12 * s12
        a01 = s02 * s12 - s01 * s22
        a02 = s01 * s12 - s02 * s11
        a11 = s00 * s22 - s02 * s02
        a12 = s01 * s02 - s00 * s12
        a22 = s00 * s11 - s01 * s01
        scaled = (
            q0 * (a00 * q0 + 2.0 * (a01 * q1 + a02 * q2))
            + q1 * (a11 * q1 + 2.0 * a12 * q2)
            + a22 * q2 * q2
        )
        distance = scaled / (s00 * a00 + s01 * a01 + s02 * a02)
        squared[p] = distance
        # exp(-s / 2) as in `kernels.d2d`: a Taylor series, squared six times. From s = 60 on no
        # window is open.
        y = -0.0078125 * min(distance, 60.0)
        e = 1.0 + y * (1.0 / 7.0) * (1.0 + y * 0.125 * (1.0 + y * (1.0 / 9.0)))
        e = 1.0 + y * 0.25 * (1.0 + y * 0.2 * (1.0 + y * (1.0 / 6.0) * e))
        e = 1.0 + y * (1.0 + y * 0.5 * (1.0 + y * (1.0 / 3.0) * e))
        e *= e
        e *= e
        e *= e
        e *= e
        e *= e
        e *= e
        v = min(1.0, max(0.0, (distance - window_start) / span))
        score += block[9, p] * e * (1.0 - v * v * v * (10.0 - 15.0 * v + 6.0 * v * v))
    return score


@kernel
def _note_meetings(
    owners: Labels, squared: Vector, count: int, limit: float, met: Mask, met_targets: Mask
) -> None:
    """Mark both sides of the pairs that are nearer than the limit."""
    for p in range(count):
        if squared[p] < limit:
            met[owners[0, p]] = True
            met_targets[owners[1, p]] = True


@kernel
def _first_beyond(ascending: Vector, value: float) -> int:
    """Return how many numbers of an ascending array lie below a value."""
    low, high = 0, ascending.shape[0]
    while low < high:
        middle = (low + high) // 2
        if ascending[middle] < value:
            low = middle + 1
        else:
            high = middle
    return low


@kernel
def met_and_score(
    target_means: Points,
    target_covariances: Matrix,
    target_widths: Vector,
    target_weights: Vector,
    along_x: Labels,
    source_means: Points,
    source_covariances: Matrix,
    source_widths: Vector,
    source_weights: Vector,
    limit: float,
    window_start: float,
    window_end: float,
) -> tuple[Mask, Mask, float]:
    """Return (m,) which sources and (k,) which targets have one near, and the D2D score of all.

    Near is a squared distance of the means, under the sum of their covariances, below `limit`.
    The score is ``sum w_i w_j exp(-s / 2) W(s)`` over the squared distances s, with the window W
    of `kernels.d2d`; `limit` is no more than its end. Both sets are in one frame. Covariances are
    (k, 6) packed upper triangles, widths the largest variances; `along_x` (k,) puts the targets
    in ascending order of x.
    """
    k = along_x.shape[0]
    x, y, z, room = np.empty(k), np.empty(k), np.empty(k), np.empty(k)
    widest = 0.0
    for t in range(k):
        j = along_x[t]
        x[t], y[t], z[t] = target_means[j, 0], target_means[j, 1], target_means[j, 2]
        room[t] = window_end * target_widths[j]
        widest = max(widest, room[t])
    excess, near = np.empty(k), np.empty(k + 1, np.int64)
    met, met_targets = np.zeros(source_means.shape[0], np.bool_), np.zeros(k, np.bool_)
    block, squared = np.empty((_PARTS, _ROW)), np.empty(_BLOCK)
    owners = np.empty((2, _BLOCK), np.int64)
    filled = 0
    score = 0.0
    for i in range(source_means.shape[0]):
        x0, y0, z0 = source_means[i, 0], source_means[i, 1], source_means[i, 2]
        own = window_end * source_widths[i]
        reach = math.sqrt(own + widest)
        first, last = _first_beyond(x, x0 - reach), _first_beyond(x, x0 + reach)
        # Slices count from zero: of other indices Numba looks at the sign, outside vector units.
        rows, rooms = along_x[first:last], room[first:last]
        xs, ys, zs = x[first:last], y[first:last], z[first:last]
        for t in range(rows.shape[0]):
            dx, dy, dz = xs[t] - x0, ys[t] - y0, zs[t] - z0
            excess[t] = dx * dx + dy * dy + dz * dz - rooms[t]
        found = np.uint64(0)
        for t in range(rows.shape[0]):
            # Written every time and kept only when in reach: no branch to guess.
            near[found] = rows[t]
            found += np.uint64(excess[t] < own)
        for t in range(np.int64(found)):
            j, p = np.uint64(near[t]), np.uint64(filled)
            for a in range(3):
                block[a, p] = source_means[i, a] - target_means[j, a]
            for a in range(6):
                block[3 + a, p] = source_covariances[i, a] + target_covariances[j, a]
            block[9, p] = source_weights[i] * target_weights[j]
            owners[0, p], owners[1, p] = i, near[t]
            filled += 1
            if filled == _BLOCK:
                score += _add_block(block, filled, window_start, window_end, squared)
                _note_meetings(owners, squared, filled, limit, met, met_targets)
                filled = 0
    score += _add_block(block, filled, window_start, window_end, squared)
    _note_meetings(owners, squared, filled, limit, met, met_targets)
    return met, met_targets, score
