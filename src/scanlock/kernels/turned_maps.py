"""The map of a scan seen from above, turned to many headings."""

import math

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Matrix, Vector
from scanlock.kernels._compile import kernel


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
    maps = np.zeros((headings.shape[0], side, side), np.float32)
    half = side // 2
    for h in range(headings.shape[0]):
        c = math.cos(headings[h]) / cell
        s = math.sin(headings[h]) / cell
        for k in range(open_columns.shape[0]):
            i = math.floor(c * open_columns[k, 0] - s * open_columns[k, 1]) + half
            j = math.floor(s * open_columns[k, 0] + c * open_columns[k, 1]) + half
            if 0 <= i < side and 0 <= j < side:
                maps[h, i, j] = -openness
        for m in range(columns.shape[0]):
            i = math.floor(c * columns[m, 0] - s * columns[m, 1]) + half
            j = math.floor(s * columns[m, 0] + c * columns[m, 1]) + half
            if 0 <= i < side and 0 <= j < side and fills[m] > maps[h, i, j]:
                maps[h, i, j] = fills[m]
    return maps
