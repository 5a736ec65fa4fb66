"""Passes over the points for ground segmentation: turning, lowest points, heights."""

import math

import numpy as np

from scanlock.arrays import Labels, Mask, Matrix, Points, Vector
from scanlock.kernels._compile import kernel


@kernel
def lowest_in_cells(points: Points, cells: Labels, cell_count: int) -> tuple[Labels, Labels]:
    """Return the row of the lowest point (-1 for none) and the point count of each cell.

    Of equally low points the one nearer the origin, then the one of smaller x, then of smaller y
    is taken, so that the order of the rows does not matter.
    """
    lowest = np.full(cell_count, -1, np.int64)
    count = np.zeros(cell_count, np.int64)
    floor = np.full(cell_count, math.inf, np.float64)
    for i in range(points.shape[0]):
        c = cells[i]
        if c < 0:
            continue
        count[c] += 1
        z = points[i, 2]
        if z < floor[c]:
            floor[c] = z
            lowest[c] = i
        elif z == floor[c]:
            j = lowest[c]
            xi = points[i, 0]
            yi = points[i, 1]
            xj = points[j, 0]
            yj = points[j, 1]
            lead = xj * xj + yj * yj - xi * xi - yi * yi
            if lead > 0.0 or (lead == 0.0 and (xi < xj or (xi == xj and yi < yj))):
                lowest[c] = i
    return lowest, count


@kernel
def turned_points(points: Points, rotation: Matrix) -> Points:
    """Return ``rotation @ p`` of each point."""
    turned = np.empty(points.shape, np.float64)
    for i in range(points.shape[0]):
        for k in range(3):
            turned[i, k] = (
                rotation[k, 0] * points[i, 0]
                + rotation[k, 1] * points[i, 1]
                + rotation[k, 2] * points[i, 2]
            )
    return turned


@kernel
def count_low_points(
    points: Points,
    cells: Labels,
    lowest: Labels,
    plane: Vector,
    near: Vector,
    reach: float,
) -> tuple[Labels, Labels]:
    """Return how many points of each cell lie near its lowest one, and within `reach` of that.

    Heights are those above `plane`, (a, b, c, d); near is ``near[c]`` metres in cell c, and
    `reach` a multiple of it.
    """
    cell_count = lowest.shape[0]
    close = np.zeros(cell_count, np.int64)
    within = np.zeros(cell_count, np.int64)
    floor = np.zeros(cell_count, np.float64)
    a = plane[0]
    b = plane[1]
    c = plane[2]
    for k in range(cell_count):
        i = lowest[k]
        if i >= 0:
            floor[k] = a * points[i, 0] + b * points[i, 1] + c * points[i, 2]
    for i in range(points.shape[0]):
        k = cells[i]
        if k < 0:
            continue
        rise = a * points[i, 0] + b * points[i, 1] + c * points[i, 2] - floor[k]
        if rise < reach * near[k]:
            within[k] += 1
            if rise < near[k]:
                close[k] += 1
    return close, within


@kernel
def heights_above_knots(
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


@kernel
def split_by_height(
    height: Vector, cells: Labels, limits: Vector, limit: float
) -> tuple[Mask, Mask, int, int]:
    """Return which heights are on the ground, which below it, and how many near and close to it.

    On the ground is within ``limits[c]`` of zero in cell c, below it under ``-limit``; near and
    close are within three and one `limit`. NaN is none of these.
    """
    n = height.shape[0]
    within = np.zeros(n, np.bool_)
    below = np.zeros(n, np.bool_)
    near = 0
    close = 0
    for i in range(n):
        h = height[i]
        if abs(h) < 3.0 * limit:
            near += 1
        if abs(h) < limit:
            close += 1
            within[i] = abs(h) < limits[cells[i]]
        below[i] = h <= -limit
    return within, below, near, close
