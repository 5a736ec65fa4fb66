"""Which cube of a grid each point lies in, found by hashing."""

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector
from scanlock.kernels._compile import kernel

_LOW_BITS = (1 << 20) - 1
"""What the hash takes of an index, so that no product overflows."""

_BLOCK = 256
"""Points whose cubes are computed at a time, for the sake of vector units."""

_FIRST_ROOM = 1024
"""Cubes there is room for at first."""

_LARGEST_KEY = 2.0**62
"""Boxes of fewer cubes than this can be numbered, which sorts faster than three columns."""


@kernel
def _slot(i: int, j: int, k: int, last: int) -> int:
    """Return where the search for a cube begins (Teschner et al. 2003)."""
    return (
        ((i & _LOW_BITS) * 73856093) ^ ((j & _LOW_BITS) * 19349663) ^ ((k & _LOW_BITS) * 83492791)
    ) & last


@kernel
def _find(table: Labels, cells: Labels, i: int, j: int, k: int) -> int:
    """Return the slot of a cube: where its row is, or the empty one where it belongs."""
    last = table.shape[0] - 1
    slot = _slot(i, j, k, last)
    row = table[slot]
    while row >= 0 and not (cells[row, 0] == i and cells[row, 1] == j and cells[row, 2] == k):
        slot = (slot + 1) & last
        row = table[slot]
    return slot


@kernel
def _wider_table(cells: Labels, count: int) -> Labels:
    """Return the table of `count` cubes with room for as many again."""
    table = np.full(8 * count, -1, np.int64)
    for row in range(count):
        table[_find(table, cells, cells[row, 0], cells[row, 1], cells[row, 2])] = row
    return table


@kernel
def _cubes(
    points: Points, start: int, corner: Vector, width: float, place: Matrix, at: Labels
) -> None:
    """Write the indices (3, b) of the cubes of the points from `start` on; `place` is scratch."""
    count = min(at.shape[1], points.shape[0] - start)
    for p in range(count):
        place[0, p] = points[start + p, 0]
        place[1, p] = points[start + p, 1]
        place[2, p] = points[start + p, 2]
    for axis in range(3):
        for p in range(at.shape[1]):
            at[axis, p] = np.int64(np.floor((place[axis, p] - corner[axis]) / width))


@kernel
def _label_points(
    points: Points, begin: int, corner: Vector, width: float, labels: Labels,
    cells: Labels, table: Labels, count: int,
) -> tuple[int, int]:  # fmt: skip
    """Label points from row `begin` on until there is no room for a new cube.

    Return the row that comes next, and how many cubes there are now. Arrays that a loop may
    replace by longer ones are counted anew at each of its rounds, which costs more than all
    else; so the loop ends, and its caller makes them longer.
    """
    n = points.shape[0]
    place = np.zeros((3, _BLOCK), np.float64)
    at = np.empty((3, _BLOCK), np.int64)
    row = -1
    for start in range(begin, n, _BLOCK):
        _cubes(points, start, corner, width, place, at)
        for p in range(min(_BLOCK, n - start)):
            i, j, k = at[0, p], at[1, p], at[2, p]
            # Neighbours in a scan mostly share a cube.
            if row < 0 or cells[row, 0] != i or cells[row, 1] != j or cells[row, 2] != k:
                slot = _find(table, cells, i, j, k)
                row = table[slot]
                if row < 0:
                    if count == cells.shape[0]:
                        return start + p, count
                    row = count
                    table[slot] = row
                    cells[row, 0], cells[row, 1], cells[row, 2] = i, j, k
                    count += 1
            labels[start + p] = row
    return n, count


@kernel
def occupied_voxels(points: Points, corner: Vector, width: float) -> tuple[Labels, Labels]:
    """Return the cube (n,) of each point, and the (m, 3) indices of the cubes with points.

    Cubes are numbered in the order of their first points. The table of the hash begins small
    and is widened as it fills, so a scan of few cubes stays in the cache.
    """
    labels = np.empty(points.shape[0], np.int64)
    cells = np.empty((_FIRST_ROOM, 3), np.int64)
    table = np.full(4 * _FIRST_ROOM, -1, np.int64)
    done, count = _label_points(points, 0, corner, width, labels, cells, table, 0)
    while done < points.shape[0]:
        cells = np.concatenate((cells, np.empty_like(cells)))
        table = _wider_table(cells, count)
        done, count = _label_points(points, done, corner, width, labels, cells, table, count)
    return labels, cells[:count].copy()


@kernel
def voxel_middles(points: Points, labels: Labels, count: int) -> Points:
    """Return the mean of the points in each of `count` cubes, numbered by `occupied_voxels`.

    Sums are taken about the first point of a cube, so no digits are lost far from zero.
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
def ascending_keys(cells: Labels) -> Labels:
    """Return (m,) numbers that ascend with (m, 3) indices, by the first, then the second.

    None at all where the box of the indices has too many cubes to be numbered.
    """
    none = np.empty(0, np.int64)
    if cells.shape[0] == 0:
        return none
    least0, least1, least2 = cells[0, 0], cells[0, 1], cells[0, 2]
    most0, most1, most2 = least0, least1, least2
    for m in range(cells.shape[0]):
        least0, most0 = min(least0, cells[m, 0]), max(most0, cells[m, 0])
        least1, most1 = min(least1, cells[m, 1]), max(most1, cells[m, 1])
        least2, most2 = min(least2, cells[m, 2]), max(most2, cells[m, 2])
    side0, side1, side2 = most0 - least0 + 1, most1 - least1 + 1, most2 - least2 + 1
    if float(side0) * float(side1) * float(side2) >= _LARGEST_KEY:
        return none
    keys = np.empty(cells.shape[0], np.int64)
    for m in range(cells.shape[0]):
        i, j, k = cells[m, 0] - least0, cells[m, 1] - least1, cells[m, 2] - least2
        keys[m] = (i * side1 + j) * side2 + k
    return keys
