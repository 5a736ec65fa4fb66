"""BEV grids of a scan, rotated to many headings."""

import math

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Matrix, Vector
from scanlock.kernels._compile import helper, kernel


@helper
def _rotated_cells(points: Matrix, c: float, s: float, side: int, cells: NDArray[np.int32]) -> None:
    """Write the cell of each rotated and scaled point (n, 2); points outside get ``side**2``.

    Without a branch or a call, so that the loop uses vector units.
    """
    half, limit = 0.5 * side, float(side)
    for k in range(points.shape[0]):
        x, y = points[k, 0], points[k, 1]
        i = np.floor(c * x - s * y) + half
        j = np.floor(s * x + c * y) + half
        is_inside = (i >= 0.0) & (i < limit) & (j >= 0.0) & (j < limit)
        cells[k] = np.int32(i * limit + j if is_inside else limit * limit)


@kernel
def rotated_grids(
    occupied: Matrix,
    occupancy: Vector,
    free: Matrix,
    free_cell_weight: float,
    headings: Vector,
    cell: float,
    side: int,
) -> NDArray[np.float32]:
    """Return (h, side, side) BEV grids of a scan rotated about the z axis by (h,) angles [rad].

    The value of a cell is the maximum occupancy of the occupied centres (m, 2) [m] in it. Without
    any it is ``-free_cell_weight`` if there is a free centre (k, 2) [m] in it, otherwise 0. The z
    axis is at the corner of the cell ``(side / 2, side / 2)``; centres outside are left out.
    """
    grids = np.zeros((headings.shape[0], side * side), np.float32)
    # The last cell takes the centres outside.
    values = np.empty(side * side + 1, np.float32)
    occupied_cells = np.empty(len(occupied), np.int32)
    free_cells = np.empty(len(free), np.int32)
    for h in range(headings.shape[0]):
        c, s = math.cos(headings[h]) / cell, math.sin(headings[h]) / cell
        _rotated_cells(free, c, s, side, free_cells)
        _rotated_cells(occupied, c, s, side, occupied_cells)
        for k in range(side * side):
            values[k] = 0.0
        for k in range(free_cells.shape[0]):
            values[np.uint32(free_cells[k])] = -free_cell_weight
        for k in range(occupied_cells.shape[0]):
            at = np.uint32(occupied_cells[k])
            values[at] = max(values[at], np.float32(occupancy[k]))
        for k in range(side * side):
            grids[h, k] = values[k]
    return grids.reshape((headings.shape[0], side, side))
