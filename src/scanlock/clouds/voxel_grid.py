"""Partition of points by a grid of cubes."""

import numpy as np

from scanlock.arrays import Labels, Points, Vector, read_only
from scanlock.errors import require_positive
from scanlock.kernels.voxels import occupied_voxels

_ZERO = read_only(np.zeros(3))


def voxel_labels(points: Points, width: float) -> tuple[Labels, int]:
    """Return the occupied voxel of each (n, 3) point, and how many there are.

    Voxels are cubes of side `width` [m] with a corner at zero, numbered by ascending index.
    """
    labels, cells = voxel_cells(points, width)
    return labels, len(cells)


def voxel_cells(points: Points, width: float, corner: Vector = _ZERO) -> tuple[Labels, Labels]:
    """Return the occupied voxel of each (n, 3) point, and the (m, 3) indices of the voxels.

    Voxels are cubes of side `width` [m], one with its lowest corner at `corner` [m] of index
    (0, 0, 0), numbered by ascending index.
    """
    require_positive("width", width, unit="m")
    labels, cells = occupied_voxels(read_only(points), read_only(corner), float(width))
    order = np.lexsort(cells.T[::-1])
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))
    return rank[labels], cells[order]


def voxel_means(points: Points, width: float) -> Points:
    """Return the mean of the points in each occupied voxel, (m, 3) with m <= n."""
    labels, count = voxel_labels(points, width)
    sums = np.stack([np.bincount(labels, points[:, a], count) for a in range(3)], axis=1)
    return sums / np.bincount(labels, minlength=count)[:, None]
