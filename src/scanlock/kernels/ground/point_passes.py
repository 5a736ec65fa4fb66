"""Passes over the points for ground segmentation: rotation, lowest points, heights."""

import math

import numpy as np

from scanlock.arrays import Labels, Mask, Matrix, Points, Vector
from scanlock.kernels._compile import helper, kernel

_BLOCK = 256
"""Points in a block, few enough for the block to stay in the cache."""


@kernel
def lowest_points(points: Points, cells: Labels, cell_count: int, min_count: int) -> Labels:
    """Return the row of the lowest point of each cell; -1 for cells with fewer than `min_count`.

    Among equally low points the one nearest the origin is taken, then the one of smallest x, then
    of smallest y, so the order of the points does not matter. `cells` (n,) is -1 for points
    outside the grid.
    """
    n = points.shape[0]
    minimum = np.full(cell_count, math.inf, np.float64)
    # Consecutive points often share a cell, and each update waits for the one before, so the two
    # halves of the scan alternate.
    half = n - n // 2
    for i in range(half):
        if cells[i] >= 0:
            c = np.uint64(cells[i])
            minimum[c] = min(minimum[c], points[i, 2])
        j = i + half
        if j < n and cells[j] >= 0:
            c = np.uint64(cells[j])
            minimum[c] = min(minimum[c], points[j, 2])
    # Rows are found afterwards, because minima alone need no branch that is hard to predict.
    lowest = np.full(cell_count, -1, np.int64)
    for i in range(points.shape[0]):
        if cells[i] < 0 or points[i, 2] != minimum[np.uint64(cells[i])]:
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
    if min_count > 1:
        count = np.zeros(cell_count, np.int64)
        for i in range(n):
            count[np.uint64(max(cells[i], 0))] += cells[i] >= 0
        for k in range(cell_count):
            if count[k] < min_count:
                lowest[k] = -1
    return lowest


@kernel
def gather_prototypes(
    points: Points, lowest: Labels, sectors: int
) -> tuple[Points, Vector, Labels, Labels]:
    """Return the points of the rows `lowest`, their ranges [m], their cells, and sector starts.

    `lowest` has one row for each cell, sector by sector; -1 for none. Sector s has the prototypes
    ``starts[s]:starts[s + 1]``.
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
def rotated_points(points: Points, rotation: Matrix) -> Points:
    """Return ``rotation @ p`` for each of (n, 3) points."""
    rotated = np.empty(points.shape, np.float64)
    xx, xy, xz = rotation[0, 0], rotation[0, 1], rotation[0, 2]
    yx, yy, yz = rotation[1, 0], rotation[1, 1], rotation[1, 2]
    zx, zy, zz = rotation[2, 0], rotation[2, 1], rotation[2, 2]
    for i in range(points.shape[0]):
        x = points[i, 0]
        y = points[i, 1]
        z = points[i, 2]
        rotated[i, 0] = xx * x + xy * y + xz * z
        rotated[i, 1] = yx * x + yy * y + yz * z
        rotated[i, 2] = zx * x + zy * y + zz * z
    return rotated


@kernel
def sharp_prototypes(
    points: Points,
    cell_of_point: Labels,
    lowest: Points,
    cells: Labels,
    plane: Vector,
    near: Vector,
    far_factor: float,
    min_ratio: float,
) -> Mask:
    """Return which prototypes are sharp: most low points of their cell are close to them.

    Of the points less than ``far_factor * near`` above the prototype, a ratio above `min_ratio`
    must be less than `near` above it.

    Parameters
    ----------
    points : (n, 3) [m]
    cell_of_point : (n,)
        -1 for points outside the grid.
    lowest : (k, 3) [m]
        Prototypes.
    cells : (k,)
        Their cells, ascending.
    plane : (4,)
        (a, b, c, d); heights are measured along (a, b, c).
    near : (bins,) [m]
        One height for each range bin.
    far_factor, min_ratio : float
    """
    bins = near.shape[0]
    cell_count = cells[cells.shape[0] - 1] + 1 if cells.shape[0] > 0 else 0
    # Heights in each cell below which a point is near, and below which it counts.
    near_end = np.empty(cell_count, np.float64)
    far_end = np.empty(cell_count, np.float64)
    close = np.zeros(cell_count, np.int64)
    within = np.zeros(cell_count, np.int64)
    a = plane[0]
    b = plane[1]
    c = plane[2]
    for j in range(cells.shape[0]):
        own = a * lowest[j, 0] + b * lowest[j, 1] + c * lowest[j, 2]
        near_end[cells[j]] = own + near[cells[j] % bins]
        far_end[cells[j]] = own + far_factor * near[cells[j] % bins]
    for i in range(points.shape[0]):
        if cell_of_point[i] < 0 or cell_of_point[i] >= cell_count:
            continue
        k = np.uint64(cell_of_point[i])
        height = a * points[i, 0] + b * points[i, 1] + c * points[i, 2]
        within[k] += height < far_end[k]
        close[k] += height < near_end[k]
    sharp = np.empty(cells.shape[0], np.bool_)
    for j in range(cells.shape[0]):
        sharp[j] = close[cells[j]] > min_ratio * within[cells[j]]
    return sharp


@helper
def _classify_heights(
    height: Vector, limits: Vector, limit: float, is_ground: Mask, is_below: Mask
) -> tuple[int, int]:
    """Write which heights are ground and below ground; return the counts of `classify_points`.

    Separate from the loop that computes the heights, because loops this simple use vector units.
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
def classify_points(
    points: Points, cells: Labels, plane: Vector, knots: Matrix, limit: float
) -> tuple[Vector, Mask, Mask, int, int]:
    """Return heights above a piecewise linear ground model, and the points on it and below it.

    Parameters
    ----------
    points : (n, 3) [m]
    cells : (n,)
        -1 for points outside the grid.
    plane : (4,)
        (a, b, c, d) with ``a x + b y + c z + d`` the height above the base plane.
    knots : (cells, 5)
        Range of the knot of each cell, height of the model above the base plane there, slopes of
        the model inwards and outwards from the knot, and largest height of a ground point. NaN
        where there is no model.
    limit : float [m]

    Returns
    -------
    height : (n,) [m]
        NaN where there is no model; such a point is none of the following.
    is_ground, is_below : (n,)
        Within the limits of the cell and `limit`; below ``-limit``.
    near, close : int
        Number of points within three and one `limit`.
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
            # Both slopes in one formula, because the sign of the step is hard to predict.
            model = knots[k, 1] + min(step, 0.0) * knots[k, 2] + max(step, 0.0) * knots[k, 3]
            height[start + i] = a * x + b * y + c * points[start + i, 2] + d - model
            limits[i] = min(limit, knots[k, 4])
        own = slice(start, start + count)
        counts = _classify_heights(height[own], limits, limit, is_ground[own], is_below[own])
        near += counts[0]
        close += counts[1]
    return height, is_ground, is_below, near, close
