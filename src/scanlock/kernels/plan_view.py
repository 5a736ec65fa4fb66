"""A scan seen from above: how full its columns are, and where its ground lies."""

import math

import numpy as np

from scanlock.arrays import Labels, Mask, Matrix, Points, Vector
from scanlock.kernels._compile import kernel


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
    side = 2 * reach
    filled = np.zeros((side, side), np.int64)
    ground = np.zeros((side, side))
    counts = np.zeros((side, side), np.int64)
    for p in range(points.shape[0]):
        if not (is_standing[p] or is_ground[p]):
            continue
        x, y, z = points[p, 0], points[p, 1], points[p, 2]
        u = level_from_scan[0, 0] * x + level_from_scan[0, 1] * y + level_from_scan[0, 2] * z
        v = level_from_scan[1, 0] * x + level_from_scan[1, 1] * y + level_from_scan[1, 2] * z
        i = math.floor((u + level_from_scan[0, 3]) / width) + reach
        j = math.floor((v + level_from_scan[1, 3]) / width) + reach
        if i < 0 or i >= side or j < 0 or j >= side:
            continue
        w = level_from_scan[2, 0] * x + level_from_scan[2, 1] * y + level_from_scan[2, 2] * z
        w += level_from_scan[2, 3]
        if is_ground[p]:
            ground[i, j] += w
            counts[i, j] += 1
            continue
        height = w if math.isnan(heights[p]) else heights[p]
        level = min(slots - 1, max(0, math.floor(height / slot)))
        filled[i, j] |= np.int64(1) << level
    for i in range(side):
        for j in range(side):
            bits = filled[i, j]
            count = 0
            while bits != 0:
                bits &= bits - 1
                count += 1
            filled[i, j] = count
            ground[i, j] = ground[i, j] / counts[i, j] if counts[i, j] > 0 else math.nan
    return filled, ground
