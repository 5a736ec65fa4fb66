"""Which occupied voxel a point lies in."""

import math

import numpy as np

from scanlock.arrays import Labels, Points
from scanlock.kernels._compile import kernel


@kernel
def voxel_rows(points: Points, places: Labels, width: float) -> Labels:
    """Return (m,) the row of the voxel that each point lies in; -1 where it is not listed.

    `places` (k, 3) are the listed voxels' coordinates in widths from zero, in ascending order of
    the first, then of the second, then of the third.
    """
    rows = np.empty(points.shape[0], np.int64)
    for i in range(points.shape[0]):
        x = np.int64(math.floor(points[i, 0] / width))
        y = np.int64(math.floor(points[i, 1] / width))
        z = np.int64(math.floor(points[i, 2] / width))
        low, high = 0, places.shape[0]
        while low < high:
            middle = (low + high) // 2
            a, b, c = places[middle, 0], places[middle, 1], places[middle, 2]
            before = a < x or (a == x and (b < y or (b == y and c < z)))
            if before:
                low = middle + 1
            else:
                high = middle
        listed = low < places.shape[0] and (
            places[low, 0] == x and places[low, 1] == y and places[low, 2] == z
        )
        rows[i] = low if listed else -1
    return rows
