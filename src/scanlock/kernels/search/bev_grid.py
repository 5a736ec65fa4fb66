"""A scan seen from above: how full its columns are, and where its ground lies."""

import math

import numpy as np

from scanlock.arrays import Labels, Mask, Matrix, Points, Vector
from scanlock.kernels._compile import kernel

_BLOCK = 256
"""Points whose columns are computed at a time, for the sake of vector units."""


@kernel
def _place_block(
    place: Vector,
    level_from_scan: Matrix,
    reach: int,
    columns_per_metre: float,
    slots_per_metre: float,
    slots: int,
    found: Vector,
) -> None:
    """Write the columns, the level z and the slots of a block of points, 3 rows of numbers.

    `place` holds x, y, z and heights, 4 rows. What lies outside gets one more column of its own.
    """
    r00, r01, r02, t0 = level_from_scan[0]
    r10, r11, r12, t1 = level_from_scan[1]
    r20, r21, r22, t2 = level_from_scan[2]
    side, last = 2.0 * reach, slots - 1.0
    for p in range(_BLOCK):
        x, y, z = place[p], place[_BLOCK + p], place[2 * _BLOCK + p]
        i = np.floor((r00 * x + r01 * y + r02 * z + t0) * columns_per_metre) + reach
        j = np.floor((r10 * x + r11 * y + r12 * z + t1) * columns_per_metre) + reach
        is_inside = (i >= 0.0) & (i < side) & (j >= 0.0) & (j < side)
        level = r20 * x + r21 * y + r22 * z + t2
        height = place[3 * _BLOCK + p]
        height = level if np.isnan(height) else height
        found[p] = i * side + j if is_inside else side * side
        found[_BLOCK + p] = level
        found[2 * _BLOCK + p] = min(last, max(0.0, np.floor(height * slots_per_metre)))


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
    """Return which slots of each column are full, and the sum and number of its ground's z.

    Column (i, j) is row ``2 i reach + j`` of both, and begins at ``(i - reach) * width`` along
    the level x axis. Its slots are the bits of a whole number, at most 62; they stand upon each
    other from the ground, and the last has no top. A standing point whose height is NaN counts
    by its level z.

    Parameters
    ----------
    points : (n, 3) [m]
    heights : (n,) [m]
    is_standing, is_ground : (n,)
    level_from_scan : (3, 4) [m]
    """
    n, columns = points.shape[0], 4 * reach * reach
    filled = np.zeros(columns + 1, np.int64)
    ground = np.zeros((columns + 1, 2), np.float64)
    place, found = np.zeros(4 * _BLOCK), np.zeros(3 * _BLOCK)
    for start in range(0, n, _BLOCK):
        count = min(_BLOCK, n - start)
        for p in range(count):
            place[p] = points[start + p, 0]
            place[_BLOCK + p] = points[start + p, 1]
            place[2 * _BLOCK + p] = points[start + p, 2]
            place[3 * _BLOCK + p] = heights[start + p]
        _place_block(place, level_from_scan, reach, 1.0 / width, 1.0 / slot, slots, found)
        for p in range(count):
            # Unsigned, as Numba looks at the sign of other indices before it uses them.
            column = np.uint32(found[p])
            if is_ground[start + p]:
                ground[column, 0] += found[_BLOCK + p]
                ground[column, 1] += 1.0
            else:
                filled[column] |= np.int64(is_standing[start + p]) << np.int64(
                    found[2 * _BLOCK + p]
                )
    return filled[:columns], ground[:columns]


@kernel
def columns_and_ground(
    filled: Labels, ground: Matrix, width: float, size: int
) -> tuple[Matrix, Labels, Matrix, Matrix]:
    """Return the full columns, their numbers of slots, those of ground alone, and its heights.

    Columns are the (k, 2) and (m, 2) middles [m] about that of the grid, row by row. Heights are
    the mean z [m] of the ground in the columns of each (size, size) block, NaN where there is
    none; `filled` and `ground` are those of `column_slots`.
    """
    side = round(math.sqrt(filled.shape[0]))
    full, slots = np.empty((side * side, 2)), np.empty(side * side, np.int64)
    opened = np.empty((side * side, 2))
    totals = np.zeros((side // size, side // size))
    counts = np.zeros((side // size, side // size))
    standing = bare = 0
    for i in range(side):
        for j in range(side):
            bits, seen = filled[i * side + j], ground[i * side + j, 1]
            if seen > 0.0:
                totals[i // size, j // size] += ground[i * side + j, 0] / seen
                counts[i // size, j // size] += 1.0
            x, y = (i + 0.5 - 0.5 * side) * width, (j + 0.5 - 0.5 * side) * width
            if bits != 0:
                full[standing, 0], full[standing, 1] = x, y
                slots[standing] = 0
                while bits != 0:
                    bits &= bits - 1
                    slots[standing] += 1
                standing += 1
            elif seen > 0.0:
                opened[bare, 0], opened[bare, 1] = x, y
                bare += 1
    for i in range(totals.shape[0]):
        for j in range(totals.shape[1]):
            totals[i, j] = totals[i, j] / counts[i, j] if counts[i, j] > 0.0 else math.nan
    return full[:standing].copy(), slots[:standing].copy(), opened[:bare].copy(), totals
