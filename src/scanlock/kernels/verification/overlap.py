"""Overlap of two sets of Gaussians: which of them have a correspondence, and their score."""

import math

import numpy as np

from scanlock.arrays import Labels, Mask, Matrix, Points, Vector
from scanlock.kernels._compile import helper, kernel, sum_helper
from scanlock.kernels._inline import (
    adjugate,
    exp_negative,
    first_not_below,
    quadratic_form,
    window,
)

_BLOCK = 256
"""Pairs in a block: loops over it, without a branch or a call, use vector units."""

_FIELDS = 10
"""Rows of a block: difference of the means (3), sum of the covariances (6), weight."""

_ROW = _BLOCK + 8
"""Length of a row. If it were a power of two, all rows would share few lines of the cache."""


@sum_helper
def _score_block(
    block: Matrix, count: int, window_start: float, window_end: float, squared: Vector
) -> float:
    """Return the score of the pairs in the first columns of a block; write their distances."""
    span = window_end - window_start
    score = 0.0
    for p in range(count):
        q = block[0, p], block[1, p], block[2, p]
        s = block[3, p], block[4, p], block[5, p], block[6, p], block[7, p], block[8, p]
        adjugate_of_s, determinant = adjugate(s)
        distance = quadratic_form(adjugate_of_s, q) / determinant
        squared[p] = distance
        # From a squared distance of 60 on no window is open.
        v = min(1.0, max(0.0, (distance - window_start) / span))
        score += block[9, p] * exp_negative(0.5 * distance) * window(v)[0]
    return score


@helper
def _mark_corresponding(
    rows: Labels,
    squared: Vector,
    count: int,
    max_squared: float,
    source_mask: Mask,
    target_mask: Mask,
) -> None:
    """Mark the source (first of two `rows`) and the target of the pairs below the threshold."""
    for p in range(count):
        if squared[p] < max_squared:
            source_mask[rows[0, p]] = True
            target_mask[rows[1, p]] = True


@kernel
def overlap_masks_and_score(
    target_means: Points,
    target_covariances: Matrix,
    target_variances: Vector,
    target_weights: Vector,
    along_x: Labels,
    source_means: Points,
    source_covariances: Matrix,
    source_variances: Vector,
    source_weights: Vector,
    max_squared: float,
    window_start: float,
    window_end: float,
) -> tuple[Mask, Mask, float]:
    """Return which Gaussians of each set have a correspondence in the other, and the D2D score.

    Two Gaussians correspond if the squared Mahalanobis distance s of their means, under the sum of
    their covariances, is below `max_squared`. The score is ``sum w_i w_j exp(-s / 2) W(s)`` over
    all pairs, with the window W of `kernels/gaussians/d2d.py`.

    Parameters
    ----------
    target_means, source_means : (k, 3), (m, 3) [m]
        In one frame.
    target_covariances, source_covariances : (k, 6), (m, 6) [m^2]
        Packed upper triangles.
    target_variances, source_variances : (k,), (m,) [m^2]
        Largest principal variances.
    target_weights, source_weights : (k,), (m,)
    along_x : (k,)
        Rows of the target in ascending order of x.
    max_squared : float
        At most `window_end`.
    window_start, window_end : float

    Returns
    -------
    source_mask : (m,)
    target_mask : (k,)
    score : float
    """
    k = along_x.shape[0]
    x, y, z, bounds = np.empty(k), np.empty(k), np.empty(k), np.empty(k)
    max_bound = 0.0
    for t in range(k):
        j = along_x[t]
        x[t], y[t], z[t] = target_means[j, 0], target_means[j, 1], target_means[j, 2]
        bounds[t] = window_end * target_variances[j]
        max_bound = max(max_bound, bounds[t])
    excess, near = np.empty(k), np.empty(k + 1, np.int64)
    source_mask = np.zeros(source_means.shape[0], np.bool_)
    target_mask = np.zeros(k, np.bool_)
    block, squared = np.empty((_FIELDS, _ROW)), np.empty(_BLOCK)
    pairs = np.empty((2, _BLOCK), np.int64)
    filled = 0
    score = 0.0
    for i in range(source_means.shape[0]):
        x0, y0, z0 = source_means[i, 0], source_means[i, 1], source_means[i, 2]
        own_bound = window_end * source_variances[i]
        radius = math.sqrt(own_bound + max_bound)
        first = first_not_below(x, 0, k, x0 - radius)
        last = first_not_below(x, 0, k, x0 + radius)
        # Slices count from zero: Numba checks the sign of other indices, outside vector units.
        rows, own_bounds = along_x[first:last], bounds[first:last]
        xs, ys, zs = x[first:last], y[first:last], z[first:last]
        for t in range(rows.shape[0]):
            dx, dy, dz = xs[t] - x0, ys[t] - y0, zs[t] - z0
            excess[t] = dx * dx + dy * dy + dz * dz - own_bounds[t]
        found = np.uint64(0)
        for t in range(rows.shape[0]):
            # Always written, kept only if near: no branch to predict.
            near[found] = rows[t]
            found += np.uint64(excess[t] < own_bound)
        for t in range(np.int64(found)):
            j, p = np.uint64(near[t]), np.uint64(filled)
            for a in range(3):
                block[a, p] = source_means[i, a] - target_means[j, a]
            for a in range(6):
                block[3 + a, p] = source_covariances[i, a] + target_covariances[j, a]
            block[9, p] = source_weights[i] * target_weights[j]
            pairs[0, p], pairs[1, p] = i, near[t]
            filled += 1
            if filled == _BLOCK:
                score += _score_block(block, filled, window_start, window_end, squared)
                _mark_corresponding(pairs, squared, filled, max_squared, source_mask, target_mask)
                filled = 0
    score += _score_block(block, filled, window_start, window_end, squared)
    _mark_corresponding(pairs, squared, filled, max_squared, source_mask, target_mask)
    return source_mask, target_mask, score
