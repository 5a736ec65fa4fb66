"""How the score of two sets of Gaussians changes when one of them slides along a line."""

import math

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector
from scanlock.kernels._compile import kernel


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
def slid_scores(
    target_means: Points,
    target_covariances: Matrix,
    target_widths: Vector,
    target_weights: Vector,
    order: Labels,
    source_means: Points,
    source_covariances: Matrix,
    source_widths: Vector,
    source_weights: Vector,
    direction: Vector,
    across: Vector,
    step: float,
    reach: int,
    window_start: float,
    window_end: float,
) -> Vector:
    """Return (2 reach + 1,) D2D scores with the source moved by -reach .. reach steps.

    The score of `kernels.meeting`, ``sum w_i w_j exp(-s / 2) W(s)``. Along the line the squared
    distance of a pair is a parabola in the shift, so each pair is looked at once. `direction` and
    `across` are unit vectors at right angles; `order` (k,) puts the targets in ascending order
    along `across`.
    """
    scores = np.zeros(2 * reach + 1)
    k = order.shape[0]
    d0, d1, d2 = direction[0], direction[1], direction[2]
    side = np.empty(k)
    widest = 0.0
    for t in range(k):
        j = order[t]
        side[t] = (
            target_means[j, 0] * across[0]
            + target_means[j, 1] * across[1]
            + target_means[j, 2] * across[2]
        )
        widest = max(widest, target_widths[j])
    span = window_end - window_start
    for i in range(source_means.shape[0]):
        x, y, z = source_means[i, 0], source_means[i, 1], source_means[i, 2]
        place = x * across[0] + y * across[1] + z * across[2]
        room = math.sqrt(window_end * (source_widths[i] + widest))
        first, last = _first_beyond(side, place - room), _first_beyond(side, place + room)
        for t in range(first, last):
            j = order[t]
            q0 = x - target_means[j, 0]
            q1 = y - target_means[j, 1]
            q2 = z - target_means[j, 2]
            along = q0 * d0 + q1 * d1 + q2 * d2
            near = window_end * (source_widths[i] + target_widths[j])
            if q0 * q0 + q1 * q1 + q2 * q2 - along * along > near:
                continue
            if max(0.0, abs(along) - step * reach) ** 2 > near:
                continue
            s00 = source_covariances[i, 0] + target_covariances[j, 0]
            s01 = source_covariances[i, 1] + target_covariances[j, 1]
            s02 = source_covariances[i, 2] + target_covariances[j, 2]
            s11 = source_covariances[i, 3] + target_covariances[j, 3]
            s12 = source_covariances[i, 4] + target_covariances[j, 4]
            s22 = source_covariances[i, 5] + target_covariances[j, 5]
            a00 = s11 * s22 - s12 * s12
            a01 = s02 * s12 - s01 * s22
            a02 = s01 * s12 - s02 * s11
            a11 = s00 * s22 - s02 * s02
            a12 = s01 * s02 - s00 * s12
            a22 = s00 * s11 - s01 * s01
            scale = 1.0 / (s00 * a00 + s01 * a01 + s02 * a02)
            u0 = scale * (a00 * d0 + a01 * d1 + a02 * d2)
            u1 = scale * (a01 * d0 + a11 * d1 + a12 * d2)
            u2 = scale * (a02 * d0 + a12 * d1 + a22 * d2)
            curvature = d0 * u0 + d1 * u1 + d2 * u2
            slope = q0 * u0 + q1 * u1 + q2 * u2
            level = scale * (
                q0 * (a00 * q0 + 2.0 * (a01 * q1 + a02 * q2))
                + q1 * (a11 * q1 + 2.0 * a12 * q2)
                + a22 * q2 * q2
            )
            lowest = level - slope * slope / curvature
            if lowest >= window_end:
                continue
            half = math.sqrt((window_end - lowest) / curvature)
            middle = -slope / curvature
            begin = max(-reach, np.int64(np.ceil((middle - half) / step)))
            end = min(reach, np.int64(np.floor((middle + half) / step)))
            weight = source_weights[i] * target_weights[j]
            # Of a parabola at equal steps, each exponential is the one before times a ratio, and
            # each ratio the one before times a constant.
            moved = begin * step
            distance = level + moved * (2.0 * slope + moved * curvature)
            likelihood = weight * math.exp(-0.5 * distance)
            ratio = math.exp(-step * (slope + (moved + 0.5 * step) * curvature))
            ratio_change = math.exp(-step * step * curvature)
            for shift in range(begin, end + 1):
                moved = shift * step
                distance = level + moved * (2.0 * slope + moved * curvature)
                v = min(1.0, max(0.0, (distance - window_start) / span))
                open_part = 1.0 - v * v * v * (10.0 - 15.0 * v + 6.0 * v * v)
                scores[reach + shift] += likelihood * open_part
                likelihood *= ratio
                ratio *= ratio_change
    return scores
