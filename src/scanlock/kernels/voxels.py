"""Which cube of a grid each point lies in, found by hashing."""

import math

import numpy as np

from scanlock.arrays import Labels, Points, Vector
from scanlock.kernels._compile import kernel

_LOW_BITS = (1 << 20) - 1
"""What the hash takes of an index, so that no product overflows."""


@kernel
def _slot(i: int, j: int, k: int, last: int) -> int:
    """Return where the search for a cube begins (Teschner et al. 2003)."""
    return (
        ((i & _LOW_BITS) * 73856093) ^ ((j & _LOW_BITS) * 19349663) ^ ((k & _LOW_BITS) * 83492791)
    ) & last


@kernel
def occupied_voxels(points: Points, corner: Vector, width: float) -> tuple[Labels, Labels]:
    """Return the cube (n,) of each point, and the (m, 3) indices of the cubes with points.

    Cubes are numbered in the order of their first points. The table of the hash begins small
    and is doubled as it fills, so a scan of few cubes stays in the cache.
    """
    n = points.shape[0]
    labels = np.empty(n, np.int64)
    cells = np.empty((64, 3), np.int64)
    table = np.full(256, -1, np.int64)
    last = table.shape[0] - 1
    count = 0
    for p in range(n):
        i = math.floor((points[p, 0] - corner[0]) / width)
        j = math.floor((points[p, 1] - corner[1]) / width)
        k = math.floor((points[p, 2] - corner[2]) / width)
        slot = _slot(i, j, k, last)
        row = table[slot]
        while row >= 0 and not (cells[row, 0] == i and cells[row, 1] == j and cells[row, 2] == k):
            slot = (slot + 1) & last
            row = table[slot]
        if row < 0:
            row = count
            table[slot] = row
            cells[row, 0], cells[row, 1], cells[row, 2] = i, j, k
            count += 1
            if count == cells.shape[0]:
                more = np.empty((2 * count, 3), np.int64)
                more[:count] = cells
                cells = more
                table = np.full(8 * count, -1, np.int64)
                last = table.shape[0] - 1
                for one in range(count):
                    slot = _slot(cells[one, 0], cells[one, 1], cells[one, 2], last)
                    while table[slot] >= 0:
                        slot = (slot + 1) & last
                    table[slot] = one
        labels[p] = row
    return labels, cells[:count].copy()
