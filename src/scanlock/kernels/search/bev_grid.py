"""BEV grid of a scan: occupied height bins, free cells and ground heights."""

import math

import numpy as np

from scanlock.arrays import Labels, Mask, Matrix, Points, Vector
from scanlock.kernels._compile import helper, kernel

_BLOCK = 256
"""Number of points processed together, in loops that use vector units."""


@helper
def _locate_block(
    coordinates: Vector,
    level_from_scan: Matrix,
    half_side: int,
    cells_per_metre: float,
    bins_per_metre: float,
    height_bins: int,
    found: Vector,
) -> None:
    """Write the cells, the levelled z and the height bins of a block of points, as 3 rows.

    `coordinates` has 4 rows: x, y, z and height. Points outside the grid get one more cell.
    """
    r00, r01, r02, t0 = level_from_scan[0]
    r10, r11, r12, t1 = level_from_scan[1]
    r20, r21, r22, t2 = level_from_scan[2]
    side, last = 2.0 * half_side, height_bins - 1.0
    for p in range(_BLOCK):
        x, y, z = coordinates[p], coordinates[_BLOCK + p], coordinates[2 * _BLOCK + p]
        i = np.floor((r00 * x + r01 * y + r02 * z + t0) * cells_per_metre) + half_side
        j = np.floor((r10 * x + r11 * y + r12 * z + t1) * cells_per_metre) + half_side
        is_inside = (i >= 0.0) & (i < side) & (j >= 0.0) & (j < side)
        level = r20 * x + r21 * y + r22 * z + t2
        height = coordinates[3 * _BLOCK + p]
        height = level if np.isnan(height) else height
        found[p] = i * side + j if is_inside else side * side
        found[_BLOCK + p] = level
        found[2 * _BLOCK + p] = min(last, max(0.0, np.floor(height * bins_per_metre)))


@kernel
def occupied_height_bins(
    points: Points,
    heights: Vector,
    is_obstacle: Mask,
    is_ground: Mask,
    level_from_scan: Matrix,
    half_side: int,
    cell_size: float,
    bin_height: float,
    height_bins: int,
) -> tuple[Labels, Matrix]:
    """Return the occupied height bins of each cell, and the sum and number of its ground's z.

    Cell (i, j) is row ``2 half_side i + j`` of both results. It begins at ``i - half_side`` and
    ``j - half_side`` cells from the z axis of the levelled frame. Its height bins are the bits of
    an integer, at most 62 from the ground upwards; the top bin has no upper end.

    Parameters
    ----------
    points : (n, 3) [m]
    heights : (n,) [m]
        Heights above the ground; where they are NaN, the levelled z is used instead.
    is_obstacle, is_ground : (n,)
    level_from_scan : (3, 4) [m]
    half_side : int
        Half the number of cells along a side.
    cell_size, bin_height : float [m]
    height_bins : int
        Number of height bins of a cell.

    Returns
    -------
    occupied_bins : (4 half_side^2,)
    ground_sums : (4 half_side^2, 2)
        Sum of z [m] and number of the ground points.
    """
    n, cells = points.shape[0], 4 * half_side * half_side
    occupied_bins = np.zeros(cells + 1, np.int64)
    ground_sums = np.zeros((cells + 1, 2), np.float64)
    coordinates, found = np.zeros(4 * _BLOCK), np.zeros(3 * _BLOCK)
    for start in range(0, n, _BLOCK):
        count = min(_BLOCK, n - start)
        for p in range(count):
            coordinates[p] = points[start + p, 0]
            coordinates[_BLOCK + p] = points[start + p, 1]
            coordinates[2 * _BLOCK + p] = points[start + p, 2]
            coordinates[3 * _BLOCK + p] = heights[start + p]
        _locate_block(
            coordinates,
            level_from_scan,
            half_side,
            1.0 / cell_size,
            1.0 / bin_height,
            height_bins,
            found,
        )
        for p in range(count):
            # Unsigned, since Numba checks the sign of other indices.
            cell = np.uint32(found[p])
            if is_ground[start + p]:
                ground_sums[cell, 0] += found[_BLOCK + p]
                ground_sums[cell, 1] += 1.0
            else:
                occupied_bins[cell] |= np.int64(is_obstacle[start + p]) << np.int64(
                    found[2 * _BLOCK + p]
                )
    return occupied_bins[:cells], ground_sums[:cells]


@kernel
def cells_and_ground(
    occupied_bins: Labels, ground_sums: Matrix, cell_size: float, block: int
) -> tuple[Matrix, Labels, Matrix, Matrix]:
    """Return occupied cells, their numbers of height bins, free cells and ground heights.

    Parameters
    ----------
    occupied_bins, ground_sums
        Results of `occupied_height_bins`.
    cell_size : float [m]
    block : int
        Cells along each side of a ground cell.

    Returns
    -------
    occupied : (k, 2) [m]
        Centres of the cells with an occupied bin, relative to the z axis.
    bin_counts : (k,)
        Number of their occupied bins.
    free : (m, 2) [m]
        Centres of the cells with ground only.
    ground_heights : (s, s) [m]
        Mean z of the ground over the cells of each block, NaN without ground.
    """
    side = round(math.sqrt(occupied_bins.shape[0]))
    occupied, bin_counts = np.empty((side * side, 2)), np.empty(side * side, np.int64)
    free = np.empty((side * side, 2))
    totals = np.zeros((side // block, side // block))
    counts = np.zeros((side // block, side // block))
    occupied_count = free_count = 0
    for i in range(side):
        for j in range(side):
            bits, count = occupied_bins[i * side + j], ground_sums[i * side + j, 1]
            if count > 0.0:
                totals[i // block, j // block] += ground_sums[i * side + j, 0] / count
                counts[i // block, j // block] += 1.0
            x, y = (i + 0.5 - 0.5 * side) * cell_size, (j + 0.5 - 0.5 * side) * cell_size
            if bits != 0:
                occupied[occupied_count, 0], occupied[occupied_count, 1] = x, y
                bin_counts[occupied_count] = 0
                while bits != 0:
                    bits &= bits - 1
                    bin_counts[occupied_count] += 1
                occupied_count += 1
            elif count > 0.0:
                free[free_count, 0], free[free_count, 1] = x, y
                free_count += 1
    for i in range(totals.shape[0]):
        for j in range(totals.shape[1]):
            totals[i, j] = totals[i, j] / counts[i, j] if counts[i, j] > 0.0 else math.nan
    return (
        occupied[:occupied_count].copy(),
        bin_counts[:occupied_count].copy(),
        free[:free_count].copy(),
        totals,
    )
