"""Passes over the points for ground segmentation: the lowest point of a cell, heights."""

import math

import numpy as np

from scanlock.arrays import Labels, Points, Vector
from scanlock.kernels._compile import kernel


@kernel
def lowest_in_cells(points: Points, cells: Labels, cell_count: int) -> tuple[Labels, Labels]:
    """Return the row of the lowest point (-1 for none) and the point count of each cell.

    Of equally low points the one nearer the origin, then the smaller x, then the smaller y
    wins, so that the order of the rows does not matter.
    """
    lowest = np.full(cell_count, -1, np.int64)
    count = np.zeros(cell_count, np.int64)
    for i in range(points.shape[0]):
        c = cells[i]
        if c < 0:
            continue
        count[c] += 1
        j = lowest[c]
        if j < 0 or points[i, 2] < points[j, 2]:
            lowest[c] = i
        elif points[i, 2] == points[j, 2]:
            a = points[i, 0] * points[i, 0] + points[i, 1] * points[i, 1]
            b = points[j, 0] * points[j, 0] + points[j, 1] * points[j, 1]
            if a < b or (
                a == b
                and (
                    points[i, 0] < points[j, 0]
                    or (points[i, 0] == points[j, 0] and points[i, 1] < points[j, 1])
                )
            ):
                lowest[c] = i
    return lowest, count


@kernel
def heights_above_model(
    points: Points,
    cells: Labels,
    plane: Vector,
    knot_range: Vector,
    knot_height: Vector,
    slope_in: Vector,
    slope_out: Vector,
) -> Vector:
    """Return the height of each point above a piecewise linear model; NaN where there is none.

    `plane` is (a, b, c, d) with ``a x + b y + c z + d`` the height above the base plane. A cell
    has one knot, the modelled height above that plane at one range, and the slopes with which
    the model leaves the knot inwards and outwards. A NaN `knot_height` means no model.
    """
    n = points.shape[0]
    height = np.empty(n, np.float64)
    a = plane[0]
    b = plane[1]
    c = plane[2]
    d = plane[3]
    for i in range(n):
        k = cells[i]
        if k < 0:
            height[i] = math.nan
            continue
        x = points[i, 0]
        y = points[i, 1]
        step = math.sqrt(x * x + y * y) - knot_range[k]
        slope = slope_in[k] if step < 0.0 else slope_out[k]
        height[i] = a * x + b * y + c * points[i, 2] + d - knot_height[k] - slope * step
    return height
