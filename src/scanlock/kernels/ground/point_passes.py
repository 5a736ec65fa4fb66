"""Passes over the points for ground segmentation: turning, lowest points, heights."""

import math

import numpy as np

from scanlock.arrays import Labels, Mask, Matrix, Points, Vector
from scanlock.kernels._compile import kernel

_BLOCK = 256
"""Points that are looked at together; what is known of them stays in the cache."""


@kernel
def lowest_in_cells(points: Points, cells: Labels, cell_count: int, least: int) -> Labels:
    """Return the row of the lowest point of each cell, -1 where a cell holds fewer than `least`.

    Of equally low points the one nearer the origin, then the one of smaller x, then of smaller y
    is taken, so that the order of the rows does not matter.
    """
    n = points.shape[0]
    floor = np.full(cell_count, math.inf, np.float64)
    # Neighbours in a scan often share a cell, and each would wait for the one before: the two
    # halves of the scan take turns.
    half = n - n // 2
    for i in range(half):
        if cells[i] >= 0:
            c = np.uint64(cells[i])
            floor[c] = min(floor[c], points[i, 2])
        j = i + half
        if j < n and cells[j] >= 0:
            c = np.uint64(cells[j])
            floor[c] = min(floor[c], points[j, 2])
    # Rows are looked for afterwards: minima alone need no branch that is hard to foretell.
    lowest = np.full(cell_count, -1, np.int64)
    for i in range(points.shape[0]):
        if cells[i] < 0 or points[i, 2] != floor[np.uint64(cells[i])]:
            continue
        c = cells[i]
        j = lowest[c]
        if j < 0:
            lowest[c] = i
            continue
        xi = points[i, 0]
        yi = points[i, 1]
        xj = points[j, 0]
        yj = points[j, 1]
        lead = xj * xj + yj * yj - xi * xi - yi * yi
        if lead > 0.0 or (lead == 0.0 and (xi < xj or (xi == xj and yi < yj))):
            lowest[c] = i
    if least > 1:
        count = np.zeros(cell_count, np.int64)
        for i in range(n):
            count[np.uint64(max(cells[i], 0))] += cells[i] >= 0
        for k in range(cell_count):
            if count[k] < least:
                lowest[k] = -1
    return lowest


@kernel
def gathered_prototypes(
    points: Points, lowest: Labels, sectors: int
) -> tuple[Points, Vector, Labels, Labels]:
    """Return the points in rows `lowest`, their ranges, their cells, and where sectors start.

    `lowest` has one row for each cell, sector by sector, -1 for none.
    """
    cell_count = lowest.shape[0]
    bins = cell_count // sectors
    starts = np.empty(sectors + 1, np.int64)
    cells = np.empty(cell_count, np.int64)
    n = 0
    for s in range(sectors):
        starts[s] = n
        for c in range(s * bins, (s + 1) * bins):
            cells[n] = c
            n += lowest[c] >= 0
    starts[sectors] = n
    low = np.empty((n, 3), np.float64)
    ranges = np.empty(n, np.float64)
    for k in range(n):
        i = lowest[cells[k]]
        x = points[i, 0]
        y = points[i, 1]
        low[k, 0] = x
        low[k, 1] = y
        low[k, 2] = points[i, 2]
        ranges[k] = math.sqrt(x * x + y * y)
    return low, ranges, cells[:n].copy(), starts


@kernel
def turned_points(points: Points, rotation: Matrix) -> Points:
    """Return ``rotation @ p`` of each point."""
    turned = np.empty(points.shape, np.float64)
    xx, xy, xz = rotation[0, 0], rotation[0, 1], rotation[0, 2]
    yx, yy, yz = rotation[1, 0], rotation[1, 1], rotation[1, 2]
    zx, zy, zz = rotation[2, 0], rotation[2, 1], rotation[2, 2]
    for i in range(points.shape[0]):
        x = points[i, 0]
        y = points[i, 1]
        z = points[i, 2]
        turned[i, 0] = xx * x + xy * y + xz * z
        turned[i, 1] = yx * x + yy * y + yz * z
        turned[i, 2] = zx * x + zy * y + zz * z
    return turned


@kernel
def sharp_prototypes(
    points: Points,
    cell_of_point: Labels,
    lowest: Points,
    cells: Labels,
    plane: Vector,
    near: Vector,
    reach: float,
    share: float,
) -> Mask:
    """Tell which of the `lowest` points, in `cells`, have the points of their cell close to them.

    Of the points that rise less than `reach` times `near` above it, a larger share than `share`
    must rise less than `near`. Heights are those above `plane`, (a, b, c, d); `near` holds metres,
    one number for each range bin.
    """
    bins = near.shape[0]
    cell_count = cells[cells.shape[0] - 1] + 1 if cells.shape[0] > 0 else 0
    # What the points of each cell are compared with: heights at which near, and reach, end.
    near_end = np.empty(cell_count, np.float64)
    reach_end = np.empty(cell_count, np.float64)
    close = np.zeros(cell_count, np.int64)
    within = np.zeros(cell_count, np.int64)
    a = plane[0]
    b = plane[1]
    c = plane[2]
    for j in range(cells.shape[0]):
        floor = a * lowest[j, 0] + b * lowest[j, 1] + c * lowest[j, 2]
        near_end[cells[j]] = floor + near[cells[j] % bins]
        reach_end[cells[j]] = floor + reach * near[cells[j] % bins]
    for i in range(points.shape[0]):
        if cell_of_point[i] < 0 or cell_of_point[i] >= cell_count:
            continue
        k = np.uint64(cell_of_point[i])
        height = a * points[i, 0] + b * points[i, 1] + c * points[i, 2]
        within[k] += height < reach_end[k]
        close[k] += height < near_end[k]
    sharp = np.empty(cells.shape[0], np.bool_)
    for j in range(cells.shape[0]):
        sharp[j] = close[cells[j]] > share * within[cells[j]]
    return sharp


@kernel
def _split_by_height(
    height: Vector, limits: Vector, limit: float, is_ground: Mask, is_below: Mask
) -> tuple[int, int]:
    """Write which heights are on the ground and below it; see `split_by_knots`.

    Apart from where heights come from, loops this simple use vector units.
    """
    near = 0
    close = 0
    for i in range(height.shape[0]):
        near += abs(height[i]) < 3.0 * limit
        close += abs(height[i]) < limit
    for i in range(height.shape[0]):
        is_ground[i] = abs(height[i]) < limits[i]
        is_below[i] = height[i] <= -limit
    return near, close


@kernel
def split_by_knots(
    points: Points, cells: Labels, plane: Vector, knots: Matrix, limit: float
) -> tuple[Vector, Mask, Mask, int, int]:
    """Return heights above a piecewise linear model, and which points are on it and below it.

    `plane` is (a, b, c, d) with ``a x + b y + c z + d`` the height above the base plane. A cell
    has one knot, a row of `knots`: a range, the modelled height above that plane there, the
    slopes with which the model leaves the knot inwards and outwards, and how close to the model
    a point of the cell is ground. NaN means no model.

    Returns
    -------
    height : (n,)
        NaN where there is no model; such a point is none of the following.
    is_ground, is_below : (n,)
        Within the limit of its cell, and within `limit`; under ``-limit``.
    near, close : int
        Points within three and one `limit`.
    """
    n = points.shape[0]
    height = np.empty(n, np.float64)
    is_ground = np.empty(n, np.bool_)
    is_below = np.empty(n, np.bool_)
    near = 0
    close = 0
    a = plane[0]
    b = plane[1]
    c = plane[2]
    d = plane[3]
    limits = np.full(_BLOCK, limit, np.float64)
    for start in range(0, n, _BLOCK):
        count = min(_BLOCK, n - start)
        for i in range(count):
            if cells[start + i] < 0:
                height[start + i] = math.nan
                continue
            k = np.uint64(cells[start + i])
            x = points[start + i, 0]
            y = points[start + i, 1]
            step = math.sqrt(x * x + y * y) - knots[k, 0]
            # Both slopes in one formula: a branch on the sign of the step is hard to foretell.
            model = knots[k, 1] + min(step, 0.0) * knots[k, 2] + max(step, 0.0) * knots[k, 3]
            height[start + i] = a * x + b * y + c * points[start + i, 2] + d - model
            limits[i] = min(limit, knots[k, 4])
        own = slice(start, start + count)
        both = _split_by_height(height[own], limits, limit, is_ground[own], is_below[own])
        near += both[0]
        close += both[1]
    return height, is_ground, is_below, near, close
