"""Low objects of a scan: their voxels and components; and occupied columns of obstacle points."""

import math

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Labels, Mask, Matrix, Points, Vector
from scanlock.kernels._compile import helper, kernel
from scanlock.kernels._inline import nine, transformed

Columns = NDArray[np.uint64]

_BITS = 64
"""Height bins of a column, one bit each."""


@kernel
def low_voxels(
    points: Points,
    heights: Vector,
    rotation: Matrix,
    min_range: float,
    max_range: float,
    min_height: float,
    voxel_size: float,
    low_layers: int,
    layers: int,
    min_points: int,
) -> tuple[Labels, Points]:
    """Return the voxels of low objects, and the means of their points.

    A voxel is a square of the level plane between two heights above the ground. Columns of two by
    two voxels with points above `low_layers` are structure, such as walls; they are left out.

    Parameters
    ----------
    points : (n, 3) [m]
    heights : (n,) [m]
        Heights above the ground; NaN if unknown.
    rotation : (3, 3)
        Rotation of the points into a level frame.
    min_range, max_range : float [m]
        Range of the points.
    min_height, voxel_size : float [m]
    low_layers, layers : int
        Numbers of layers of voxels from `min_height` on: low ones, and all.
    min_points : int
        Minimum number of points of a voxel.

    Returns
    -------
    voxels : (k, 3)
        Column along x and y, and layer of each voxel.
    means : (k, 3) [m]
        Mean of the points of each voxel.
    """
    n = points.shape[0]
    half = 2 * math.ceil(0.5 * max_range / voxel_size)
    side = 2 * half
    counts = np.zeros(side * side * layers, np.int32)
    # The points between the heights with their voxels, and the voxels in order of their points.
    in_band, voxel_of_point = np.empty(n, np.int32), np.empty(n, np.int32)
    occupied = np.empty(n, np.int32)
    selected, occupied_count = 0, 0
    top = min_height + layers * voxel_size
    r0, r1, r2, r3, r4, r5, _, _, _ = nine(rotation)
    for p in range(n):
        height = heights[p]
        if not min_height <= height < top:
            continue
        x, y, z = points[p, 0], points[p, 1], points[p, 2]
        squared = x * x + y * y + z * z
        if squared < min_range * min_range or squared >= max_range * max_range:
            continue
        i = math.floor((r0 * x + r1 * y + r2 * z) / voxel_size) + half
        j = math.floor((r3 * x + r4 * y + r5 * z) / voxel_size) + half
        layer = min(int((height - min_height) / voxel_size), layers - 1)
        voxel = (i * side + j) * layers + layer
        if counts[voxel] == 0:
            occupied[occupied_count] = voxel
            occupied_count += 1
        counts[voxel] += 1
        in_band[selected] = p
        voxel_of_point[selected] = voxel
        selected += 1
    is_structure = np.zeros((half, half), np.bool_)
    for k in range(occupied_count):
        column = occupied[k] // layers
        if occupied[k] % layers >= low_layers and counts[occupied[k]] >= min_points:
            is_structure[column // side // 2, column % side // 2] = True
    # From here on a count is the row of its voxel, or -1.
    found = 0
    for k in range(occupied_count):
        column, layer = occupied[k] // layers, occupied[k] % layers
        is_low = layer < low_layers and not is_structure[column // side // 2, column % side // 2]
        if is_low and counts[occupied[k]] >= min_points:
            occupied[found] = occupied[k]
            counts[occupied[k]] = found
            found += 1
        else:
            counts[occupied[k]] = -1
    voxels, means = np.empty((found, 3), np.int64), np.zeros((found, 3))
    numbers = np.zeros(found)
    for row in range(found):
        column = occupied[row] // layers
        voxels[row, 0] = column // side
        voxels[row, 1] = column % side
        voxels[row, 2] = occupied[row] % layers
    for k in range(selected):
        row = counts[voxel_of_point[k]]
        if row >= 0:
            numbers[row] += 1.0
            for axis in range(3):
                means[row, axis] += points[in_band[k], axis]
    for row in range(found):
        for axis in range(3):
            means[row, axis] /= numbers[row]
    return voxels, means


@helper
def _root(parents: Labels, row: int) -> int:
    """Return the root of a row, and shorten the way to it."""
    while parents[row] != row:
        parents[row] = parents[parents[row]]
        row = parents[row]
    return row


@kernel
def joined_voxels(voxels: Labels) -> tuple[Labels, int]:
    """Return the component of each voxel, and the number of components.

    Voxels (k, 3) that share a face, an edge or a corner are joined. Components are numbered by
    their first voxels.
    """
    count = voxels.shape[0]
    parents = np.arange(count)
    shape = np.zeros(3, np.int64)
    for row in range(count):
        for axis in range(3):
            shape[axis] = max(shape[axis], voxels[row, axis] + 3)
    # One empty voxel around all of them.
    rows = np.full(shape[0] * shape[1] * shape[2], -1, np.int32)
    for row in range(count):
        i, j, k = voxels[row, 0] + 1, voxels[row, 1] + 1, voxels[row, 2] + 1
        for di in range(-1, 2):
            for dj in range(-1, 2):
                for dk in range(-1, 2):
                    near = int(rows[((i + di) * shape[1] + j + dj) * shape[2] + k + dk])
                    if near >= 0:
                        a, b = _root(parents, near), _root(parents, row)
                        parents[max(a, b)] = min(a, b)
        rows[(i * shape[1] + j) * shape[2] + k] = row
    labels = np.empty(count, np.int64)
    components = 0
    for row in range(count):
        root = _root(parents, row)
        if root == row:
            labels[row] = components
            components += 1
        else:
            labels[row] = labels[root]
    return labels, components


@kernel
def occupied_columns(
    points: Points, rotation: Matrix, base: float, cell: float, side: int
) -> Columns:
    """Return the (side, side) columns of a level frame with a bit for each occupied height bin.

    Bit b is the bin of heights from ``base + b cell`` on [m]. Points (n, 3) [m] outside of the
    columns are left out.
    """
    columns = np.zeros((side, side), np.uint64)
    half = side // 2
    r0, r1, r2, r3, r4, r5, r6, r7, r8 = nine(rotation)
    for p in range(points.shape[0]):
        x, y, z = points[p, 0], points[p, 1], points[p, 2]
        i = math.floor((r0 * x + r1 * y + r2 * z) / cell) + half
        j = math.floor((r3 * x + r4 * y + r5 * z) / cell) + half
        b = math.floor((r6 * x + r7 * y + r8 * z - base) / cell)
        if 0 <= i < side and 0 <= j < side and 0 <= b < _BITS:
            columns[i, j] |= np.uint64(1) << np.uint64(b)
    return columns


@helper
def _is_near(
    columns: Columns, base: float, cell: float, x: float, y: float, z: float, reach: float
) -> bool:
    """Return whether an occupied bin has its centre within a distance of a level point."""
    side = columns.shape[0]
    half = side // 2
    steps = int(reach / cell + 0.5)
    i0 = math.floor(x / cell) + half
    j0 = math.floor(y / cell) + half
    if i0 < steps or j0 < steps or i0 >= side - steps or j0 >= side - steps:
        return False
    for i in range(i0 - steps, i0 + steps + 1):
        dx = (i - half + 0.5) * cell - x
        for j in range(j0 - steps, j0 + steps + 1):
            if columns[i, j] == np.uint64(0):
                continue
            dy = (j - half + 0.5) * cell - y
            left = reach * reach - dx * dx - dy * dy
            if left < 0.0:
                continue
            up = math.sqrt(left)
            low = math.ceil((z - up - base) / cell - 0.5)
            high = math.floor((z + up - base) / cell - 0.5)
            low, high = max(low, 0), min(high, _BITS - 1)
            for b in range(low, high + 1):
                if (columns[i, j] >> np.uint64(b)) & np.uint64(1):
                    return True
    return False


@kernel
def near_obstacles(
    columns: Columns, rotation: Matrix, base: float, cell: float, reach: float, points: Points
) -> Mask:
    """Return whether each of (n, 3) points [m] is within a distance [m] of an occupied bin.

    `rotation` takes the points into the level frame of the columns; see `occupied_columns`.
    """
    r, zero = nine(rotation), (0.0, 0.0, 0.0)
    is_near = np.empty(points.shape[0], np.bool_)
    for p in range(points.shape[0]):
        x, y, z = transformed(r, zero, points[p, 0], points[p, 1], points[p, 2])
        is_near[p] = _is_near(columns, base, cell, x, y, z, reach)
    return is_near
