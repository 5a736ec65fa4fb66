"""Choosing rows of points."""

import numpy as np

from scanlock.arrays import Mask, Points
from scanlock.kernels._compile import kernel


@kernel
def is_off_zero(points: Points) -> Mask:
    """Return which points lie anywhere but at exactly (0, 0, 0)."""
    is_off = np.empty(points.shape[0], np.bool_)
    for i in range(points.shape[0]):
        is_off[i] = points[i, 0] != 0.0 or points[i, 1] != 0.0 or points[i, 2] != 0.0
    return is_off


@kernel
def chosen_points(points: Points, is_chosen: Mask) -> Points:
    """Return the (m, 3) points for which the mask holds, in order."""
    count = 0
    for i in range(points.shape[0]):
        count += is_chosen[i]
    # One row more, for the last points when none of them is chosen: each is written where the
    # next chosen one belongs, and only a chosen one stays. That leaves no branch to guess.
    chosen = np.empty((count + 1, 3), np.float64)
    place = np.uint64(0)
    for i in range(points.shape[0]):
        chosen[place, 0] = points[i, 0]
        chosen[place, 1] = points[i, 1]
        chosen[place, 2] = points[i, 2]
        place += np.uint64(is_chosen[i])
    return chosen[:count]
