"""Scores of two sets of Gaussians as a function of a shift of the source along a direction."""

import math

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector
from scanlock.kernels._compile import helper, inlined, kernel
from scanlock.kernels._inline import (
    Symmetric,
    Triple,
    adjugate,
    dot,
    first_not_below,
    product,
    quadratic_form,
    summed,
    symmetric,
    triple,
    window,
)


@inlined
def _parabola(q: Triple, d: Triple, covariance: Symmetric) -> Triple:
    """Return a, b, c of the squared Mahalanobis distance ``a t^2 + 2 b t + c`` of ``q + t d``."""
    adjugate_matrix, determinant = adjugate(covariance)
    scale = 1.0 / determinant
    v0, v1, v2 = product(adjugate_matrix, d)
    u = scale * v0, scale * v1, scale * v2
    return dot(d, u), dot(q, u), scale * quadratic_form(adjugate_matrix, q)


@helper
def _add_profile(
    a: float, b: float, c: float, weight: float,
    step: float, max_steps: int, window_start: float, window_end: float, scores: Vector,
) -> None:  # fmt: skip
    """Add ``w exp(-s / 2) W(s)`` at each shift t to the scores, with ``s = a t^2 + 2 b t + c``."""
    smallest = c - b * b / a
    if smallest >= window_end:
        return
    half = math.sqrt((window_end - smallest) / a)
    middle = -b / a
    begin = max(-max_steps, np.int64(np.ceil((middle - half) / step)))
    end = min(max_steps, np.int64(np.floor((middle + half) / step)))
    span = window_end - window_start
    # For a parabola at equal steps, each exponential is the previous one times a ratio, and each
    # ratio the previous one times a constant.
    t = begin * step
    squared = c + t * (2.0 * b + t * a)
    likelihood = weight * math.exp(-0.5 * squared)
    ratio = math.exp(-step * (b + (t + 0.5 * step) * a))
    ratio_change = math.exp(-step * step * a)
    for shift in range(begin, end + 1):
        t = shift * step
        squared = c + t * (2.0 * b + t * a)
        v = min(1.0, max(0.0, (squared - window_start) / span))
        scores[max_steps + shift] += likelihood * window(v)[0]
        likelihood *= ratio
        ratio *= ratio_change


@kernel
def scores_along_direction(
    target_means: Points,
    target_covariances: Matrix,
    target_variances: Vector,
    target_weights: Vector,
    order: Labels,
    source_means: Points,
    source_covariances: Matrix,
    source_variances: Vector,
    source_weights: Vector,
    direction: Vector,
    across: Vector,
    step: float,
    max_steps: int,
    window_start: float,
    window_end: float,
) -> Vector:
    """Return the D2D scores of the source shifted by ``-max_steps .. max_steps`` steps.

    The score is that of `overlap.overlap_masks_and_score`. Along the direction the squared
    distance of a pair is a parabola in the shift, so each pair is evaluated once.

    Parameters
    ----------
    target_means, source_means : (k, 3), (m, 3) [m]
        In one frame.
    target_covariances, source_covariances : (k, 6), (m, 6) [m^2]
        Packed upper triangles.
    target_variances, source_variances : (k,), (m,) [m^2]
        Largest principal variances.
    target_weights, source_weights : (k,), (m,)
    order : (k,)
        Rows of the target in ascending order along `across`.
    direction, across : (3,)
        Orthogonal unit vectors: of the shift, and of the search for neighbours.
    step : float [m]
    max_steps : int
    window_start, window_end : float

    Returns
    -------
    scores : (2 max_steps + 1,)
    """
    scores = np.zeros(2 * max_steps + 1)
    k = order.shape[0]
    d, e = triple(direction), triple(across)
    sorted_positions = np.empty(k)
    max_variance = 0.0
    for t in range(k):
        sorted_positions[t] = dot(triple(target_means[order[t]]), e)
        max_variance = max(max_variance, target_variances[order[t]])
    for i in range(source_means.shape[0]):
        x, y, z = triple(source_means[i])
        position = x * e[0] + y * e[1] + z * e[2]
        radius = math.sqrt(window_end * (source_variances[i] + max_variance))
        first = first_not_below(sorted_positions, 0, k, position - radius)
        last = first_not_below(sorted_positions, 0, k, position + radius)
        for t in range(first, last):
            j = order[t]
            q = x - target_means[j, 0], y - target_means[j, 1], z - target_means[j, 2]
            along = dot(q, d)
            max_squared = window_end * (source_variances[i] + target_variances[j])
            if dot(q, q) - along * along > max_squared:
                continue
            if max(0.0, abs(along) - step * max_steps) ** 2 > max_squared:
                continue
            covariance = summed(symmetric(source_covariances, i), symmetric(target_covariances, j))
            a, b, c = _parabola(q, d, covariance)
            weight = source_weights[i] * target_weights[j]
            _add_profile(a, b, c, weight, step, max_steps, window_start, window_end, scores)
    return scores
