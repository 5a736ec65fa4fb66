"""Selection of points by a mask."""

import numpy as np

from scanlock.arrays import Mask, Points
from scanlock.kernels._compile import kernel


@kernel
def is_nonzero(points: Points) -> Mask:
    """Return which of (n, 3) points differ from exactly (0, 0, 0)."""
    found = np.empty(points.shape[0], np.bool_)
    for i in range(points.shape[0]):
        found[i] = points[i, 0] != 0.0 or points[i, 1] != 0.0 or points[i, 2] != 0.0
    return found


@kernel
def selected_points(points: Points, mask: Mask) -> Points:
    """Return the (m, 3) points for which the mask (n,) is true, in order."""
    count = 0
    for i in range(points.shape[0]):
        count += mask[i]
    # Each point is written to the next free row, and kept only if selected: no branch to predict.
    # One more row takes the last points that are not.
    selected = np.empty((count + 1, 3), np.float64)
    row = np.uint64(0)
    for i in range(points.shape[0]):
        selected[row, 0] = points[i, 0]
        selected[row, 1] = points[i, 1]
        selected[row, 2] = points[i, 2]
        row += np.uint64(mask[i])
    return selected[:count]
