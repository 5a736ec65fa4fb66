"""Voxels of points, found by hashing, their centroids and their order."""

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector
from scanlock.kernels._compile import helper, kernel
from scanlock.kernels._inline import find_voxel

_BLOCK = 256
"""Points whose voxels are computed together, in loops that use vector units."""

_CAPACITY = 1024
"""Initial capacity in voxels."""

_MAX_KEY = 2.0**62
"""Boxes of fewer voxels than this can be numbered, which sorts faster than three columns."""


@helper
def _larger_table(voxels: Labels, count: int) -> Labels:
    """Return the hash table of `count` voxels with room for as many again."""
    table = np.full(8 * count, -1, np.int64)
    for row in range(count):
        slot, _ = find_voxel(table, voxels, voxels[row, 0], voxels[row, 1], voxels[row, 2])
        table[slot] = row
    return table


@helper
def _indices_of_block(
    points: Points, start: int, corner: Vector, voxel_size: float, scratch: Matrix, indices: Labels
) -> None:
    """Write the voxel indices (3, b) of a block of points."""
    count = min(indices.shape[1], points.shape[0] - start)
    for p in range(count):
        scratch[0, p] = points[start + p, 0]
        scratch[1, p] = points[start + p, 1]
        scratch[2, p] = points[start + p, 2]
    for axis in range(3):
        for p in range(indices.shape[1]):
            indices[axis, p] = np.int64(np.floor((scratch[axis, p] - corner[axis]) / voxel_size))


@helper
def _label_points(
    points: Points, begin: int, corner: Vector, voxel_size: float, labels: Labels,
    voxels: Labels, table: Labels, count: int,
) -> tuple[int, int]:  # fmt: skip
    """Label points from row `begin` on until there is no room for a new voxel.

    Return the next row and the number of voxels. The caller makes room: a loop that may replace
    an array by a longer one updates its reference count in each iteration, which costs more than
    all the rest.
    """
    n = points.shape[0]
    scratch = np.zeros((3, _BLOCK), np.float64)
    indices = np.empty((3, _BLOCK), np.int64)
    row = -1
    for start in range(begin, n, _BLOCK):
        _indices_of_block(points, start, corner, voxel_size, scratch, indices)
        for p in range(min(_BLOCK, n - start)):
            i, j, k = indices[0, p], indices[1, p], indices[2, p]
            # Consecutive points mostly share a voxel.
            if row < 0 or voxels[row, 0] != i or voxels[row, 1] != j or voxels[row, 2] != k:
                slot, row = find_voxel(table, voxels, i, j, k)
                if row < 0:
                    if count == voxels.shape[0]:
                        return start + p, count
                    row = count
                    table[slot] = row
                    voxels[row, 0], voxels[row, 1], voxels[row, 2] = i, j, k
                    count += 1
            labels[start + p] = row
    return n, count


@kernel
def occupied_voxels(points: Points, corner: Vector, voxel_size: float) -> tuple[Labels, Labels]:
    """Return the voxel (n,) of each point, and the (m, 3) indices of the occupied voxels.

    Voxels are numbered in the order of their first points; voxel (0, 0, 0) begins at `corner` [m].
    The hash table starts small and grows as it fills, so it stays in the cache for scans of few
    voxels.
    """
    labels = np.empty(points.shape[0], np.int64)
    voxels = np.empty((_CAPACITY, 3), np.int64)
    table = np.full(4 * _CAPACITY, -1, np.int64)
    done, count = _label_points(points, 0, corner, voxel_size, labels, voxels, table, 0)
    while done < points.shape[0]:
        voxels = np.concatenate((voxels, np.empty_like(voxels)))
        table = _larger_table(voxels, count)
        done, count = _label_points(points, done, corner, voxel_size, labels, voxels, table, count)
    return labels, voxels[:count].copy()


@kernel
def voxel_centroids(points: Points, labels: Labels, count: int) -> Points:
    """Return the centroid [m] of the points in each of `count` voxels of `occupied_voxels`.

    Offsets are relative to the first point of a voxel, which loses no digits far from the origin.
    """
    firsts, sums, sizes = np.empty((count, 3)), np.zeros((count, 3)), np.zeros(count, np.int64)
    seen = 0
    for p in range(points.shape[0]):
        row = labels[p]
        x, y, z = points[p, 0], points[p, 1], points[p, 2]
        if row == seen:
            firsts[row, 0], firsts[row, 1], firsts[row, 2] = x, y, z
            seen += 1
        sums[row, 0] += x - firsts[row, 0]
        sums[row, 1] += y - firsts[row, 1]
        sums[row, 2] += z - firsts[row, 2]
        sizes[row] += 1
    for row in range(count):
        for axis in range(3):
            firsts[row, axis] += sums[row, axis] / sizes[row]
    return firsts


@kernel
def row_major_keys(voxels: Labels) -> Labels:
    """Return the (m,) row-major numbers of (m, 3) voxel indices within their bounding box.

    The result is empty if the box has too many voxels to be numbered.
    """
    none = np.empty(0, np.int64)
    if voxels.shape[0] == 0:
        return none
    min0, min1, min2 = voxels[0, 0], voxels[0, 1], voxels[0, 2]
    max0, max1, max2 = min0, min1, min2
    for m in range(voxels.shape[0]):
        min0, max0 = min(min0, voxels[m, 0]), max(max0, voxels[m, 0])
        min1, max1 = min(min1, voxels[m, 1]), max(max1, voxels[m, 1])
        min2, max2 = min(min2, voxels[m, 2]), max(max2, voxels[m, 2])
    side0, side1, side2 = max0 - min0 + 1, max1 - min1 + 1, max2 - min2 + 1
    if float(side0) * float(side1) * float(side2) >= _MAX_KEY:
        return none
    keys = np.empty(voxels.shape[0], np.int64)
    for m in range(voxels.shape[0]):
        i, j, k = voxels[m, 0] - min0, voxels[m, 1] - min1, voxels[m, 2] - min2
        keys[m] = (i * side1 + j) * side2 + k
    return keys
