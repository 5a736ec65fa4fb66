"""A scan seen from above: how full its columns are, and where its ground lies."""

import math

import numpy as np

from scanlock.arrays import Labels, Mask, Matrix, Points, Vector
from scanlock.kernels._compile import kernel

_BLOCK = 256
"""Points whose columns are computed at a time, for the sake of vector units."""


@kernel
def _place_block(
    place: Vector, level_from_scan: Matrix, reach: int, width: float, found: Vector
) -> None:
    """Write the columns and the level z of a block of points, both as 2 rows of numbers."""
    r00, r01, r02, t0 = level_from_scan[0]
    r10, r11, r12, t1 = level_from_scan[1]
    r20, r21, r22, t2 = level_from_scan[2]
    side = 2.0 * reach
    for p in range(_BLOCK):
        x, y, z = place[p], place[_BLOCK + p], place[2 * _BLOCK + p]
        i = np.floor((r00 * x + r01 * y + r02 * z + t0) / width) + reach
        j = np.floor((r10 * x + r11 * y + r12 * z + t1) / width) + reach
        column = i * side + j
        column = column if (i >= 0.0) & (i < side) & (j >= 0.0) & (j < side) else -1.0
        found[p] = column
        found[_BLOCK + p] = r20 * x + r21 * y + r22 * z + t2


@kernel
def column_slots(
    points: Points,
    heights: Vector,
    is_standing: Mask,
    is_ground: Mask,
    level_from_scan: Matrix,
    reach: int,
    width: float,
    slot: float,
    slots: int,
) -> tuple[Labels, Matrix]:
    """Return two (2 reach, 2 reach) grids: full slots of a column, and level z of its ground.

    The ground is the mean of its points, NaN where none was seen.
    Column (i, j) begins at ``(i - reach) * width`` along the level x axis; its slots stand upon
    each other from the ground, and the last has no top. A standing point whose height is NaN
    counts by its level z. At most 62 slots.

    Parameters
    ----------
    points : (n, 3) [m]
    heights : (n,) [m]
    is_standing, is_ground : (n,)
    level_from_scan : (3, 4) [m]
    """
    n, side = points.shape[0], 2 * reach
    filled = np.zeros(side * side, np.int64)
    ground = np.zeros(side * side)
    counts = np.zeros(side * side, np.int32)
    place, found = np.zeros(3 * _BLOCK), np.zeros(2 * _BLOCK)
    for start in range(0, n, _BLOCK):
        count = min(_BLOCK, n - start)
        for p in range(count):
            place[p] = points[start + p, 0]
            place[_BLOCK + p] = points[start + p, 1]
            place[2 * _BLOCK + p] = points[start + p, 2]
        _place_block(place, level_from_scan, reach, width, found)
        for p in range(count):
            column = np.int32(found[p])
            if column < 0:
                continue
            if is_ground[start + p]:
                ground[column] += found[_BLOCK + p]
                counts[column] += 1
            elif is_standing[start + p]:
                height = heights[start + p]
                height = found[_BLOCK + p] if math.isnan(height) else height
                level = min(slots - 1, max(0, math.floor(height / slot)))
                filled[column] |= np.int64(1) << level
    for column in range(side * side):
        bits = filled[column]
        count = 0
        while bits != 0:
            bits &= bits - 1
            count += 1
        filled[column] = count
        seen = counts[column]
        ground[column] = ground[column] / seen if seen > 0 else math.nan
    return filled.reshape((side, side)), ground.reshape((side, side))


@kernel
def block_means(grid: Matrix, size: int) -> Matrix:
    """Return the mean of the numbers in each (size, size) block of a grid, NaN where none is."""
    rows, columns = grid.shape[0] // size, grid.shape[1] // size
    means = np.empty((rows, columns))
    for i in range(rows):
        for j in range(columns):
            total, count = 0.0, 0
            for a in range(i * size, (i + 1) * size):
                for b in range(j * size, (j + 1) * size):
                    if not math.isnan(grid[a, b]):
                        total += grid[a, b]
                        count += 1
            means[i, j] = total / count if count > 0 else math.nan
    return means


@kernel
def full_and_open_columns(
    filled: Labels, ground: Matrix, width: float
) -> tuple[Matrix, Labels, Matrix]:
    """Return the columns where something stands, their full slots, and those of ground alone.

    Columns are the (k, 2) and (m, 2) middles [m] about that of the grid, row by row.
    """
    side = filled.shape[0]
    full, slots = np.empty((side * side, 2)), np.empty(side * side, np.int64)
    opened = np.empty((side * side, 2))
    standing = bare = 0
    for i in range(side):
        for j in range(side):
            x, y = (i + 0.5 - 0.5 * side) * width, (j + 0.5 - 0.5 * side) * width
            if filled[i, j] > 0:
                full[standing, 0], full[standing, 1] = x, y
                slots[standing] = filled[i, j]
                standing += 1
            elif not math.isnan(ground[i, j]):
                opened[bare, 0], opened[bare, 1] = x, y
                bare += 1
    return full[:standing].copy(), slots[:standing].copy(), opened[:bare].copy()
