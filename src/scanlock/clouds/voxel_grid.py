"""Partition of points by a grid of cubes."""

import numpy as np

from scanlock.arrays import Labels, Points
from scanlock.errors import require_positive

_MOST_KEYS = 2.0**62
"""Grids of more voxels than this have no 64-bit number for each."""


def voxel_labels(points: Points, width: float) -> tuple[Labels, int]:
    """Return the occupied voxel of each (n, 3) point, and how many there are.

    Voxels are cubes of side `width` [m] with a corner at zero, numbered by ascending index.
    """
    require_positive("width", width, unit="m")
    index = np.floor(points / width).astype(np.int64)
    index -= index.min(axis=0, initial=0)
    shape = index.max(axis=0, initial=0) + 1
    if np.prod(shape.astype(np.float64)) < _MOST_KEYS:
        key = (index[:, 0] * shape[1] + index[:, 1]) * shape[2] + index[:, 2]
        occupied, labels = np.unique(key, return_inverse=True)
    else:
        occupied, labels = np.unique(index, axis=0, return_inverse=True)
    return labels.astype(np.int64).reshape(-1), len(occupied)


def voxel_means(points: Points, width: float) -> Points:
    """Return the mean of the points in each occupied voxel, (m, 3) with m <= n."""
    labels, count = voxel_labels(points, width)
    sums = np.stack([np.bincount(labels, points[:, a], count) for a in range(3)], axis=1)
    return sums / np.bincount(labels, minlength=count)[:, None]
