"""The map of a scan seen from above, turned to many headings."""

import math

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Matrix, Vector
from scanlock.kernels._compile import kernel


@kernel
def _turned_cells(points: Matrix, c: float, s: float, side: int, cells: NDArray[np.int32]) -> None:
    """Write the cell of each point (n, 2) turned and scaled; beyond the map the one after all.

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
def turned_maps(
    columns: Matrix,
    fills: Vector,
    open_columns: Matrix,
    openness: float,
    headings: Vector,
    cell: float,
    side: int,
) -> NDArray[np.float32]:
    """Return (h, side, side) maps of a scan turned about the z axis by (h,) angles [rad].

    A cell holds the fullest of the columns (m, 2) [m] whose centre lies in it; where there is
    none but open ground (k, 2) [m] it holds ``-openness``, and elsewhere 0. The axis is the
    corner of the cell ``(side / 2, side / 2)``; what lies beyond the map is left out.
    """
    maps = np.zeros((headings.shape[0], side * side), np.float32)
    # One cell more, for what lies beyond.
    own = np.empty(side * side + 1, np.float32)
    full, opened = np.empty(len(columns), np.int32), np.empty(len(open_columns), np.int32)
    for h in range(headings.shape[0]):
        c, s = math.cos(headings[h]) / cell, math.sin(headings[h]) / cell
        _turned_cells(open_columns, c, s, side, opened)
        _turned_cells(columns, c, s, side, full)
        for k in range(side * side):
            own[k] = 0.0
        for k in range(opened.shape[0]):
            own[np.uint32(opened[k])] = -openness
        for k in range(full.shape[0]):
            at = np.uint32(full[k])
            own[at] = max(own[at], np.float32(fills[k]))
        for k in range(side * side):
            maps[h, k] = own[k]
    return maps.reshape((headings.shape[0], side, side))
