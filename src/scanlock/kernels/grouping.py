"""Grouping of points: numbering of occupied cells and cutting of parts that are too long."""

import math

import numpy as np

from scanlock.arrays import Labels, Points
from scanlock.kernels._compile import kernel

_ON_THE_PLANE = 1e-9
"""Share of a part's extent within which a point counts as on the cutting plane."""


@kernel
def occupied_cells(cells: Labels, cell_count: int) -> tuple[Labels, Labels]:
    """Return the part (n,) of each row and the cell of each part, for cells in [0, cell_count).

    Parts are numbered by ascending cell, so the order of the rows does not matter. Negative
    cells keep the label -1.
    """
    part_of_cell = np.full(cell_count, -1, np.int64)
    for i in range(cells.shape[0]):
        if cells[i] >= 0:
            part_of_cell[cells[i]] = 0
    count = 0
    for c in range(cell_count):
        if part_of_cell[c] == 0:
            part_of_cell[c] = count
            count += 1
    parts = np.full(cells.shape[0], -1, np.int64)
    for i in range(cells.shape[0]):
        if cells[i] >= 0:
            parts[i] = part_of_cell[cells[i]]
    cell_of_part = np.empty(count, np.int64)
    for c in range(cell_count):
        if part_of_cell[c] >= 0:
            cell_of_part[part_of_cell[c]] = c
    return parts, cell_of_part


@kernel
def split_by_extent(
    points: Points, labels: Labels, parts: int, largest_radius: float
) -> tuple[Labels, int]:
    """Return labels in which no part has a point farther than `largest_radius` from its mean.

    A part that has is cut in two by the plane through its mean across its longest axis, again
    and again. Each cut depends only on the set of points, so neither their order nor the
    numbering of the parts changes which points stay together; points on the plane, but for
    rounding, go to the far side.
    """
    n = points.shape[0]
    starts = np.zeros(parts + 1, np.int64)
    for i in range(n):
        if labels[i] >= 0:
            starts[labels[i] + 1] += 1
    for k in range(parts):
        starts[k + 1] += starts[k]
    order = np.empty(starts[parts], np.int64)
    cursor = starts[:-1].copy()
    for i in range(n):
        if labels[i] >= 0:
            order[cursor[labels[i]]] = i
            cursor[labels[i]] += 1

    result = np.full(n, -1, np.int64)
    # A stack of runs of `order` still to be cut or kept; a run of one point is never cut.
    begins = np.empty(n + 1, np.int64)
    ends = np.empty(n + 1, np.int64)
    mean = np.empty(3)
    axis = np.empty(3)
    count = 0
    for k in range(parts):
        if starts[k] == starts[k + 1]:
            continue
        begins[0], ends[0] = starts[k], starts[k + 1]
        depth = 1
        while depth > 0:
            depth -= 1
            begin, end = begins[depth], ends[depth]
            farthest = _mean_and_axis(points, order, begin, end, mean, axis)
            if farthest <= largest_radius:
                for m in range(begin, end):
                    result[order[m]] = count
                count += 1
                continue
            margin = -_ON_THE_PLANE * farthest
            # Rows on the near side are swapped to the front of the run.
            middle = begin
            for m in range(begin, end):
                i = order[m]
                along = (
                    (points[i, 0] - mean[0]) * axis[0]
                    + (points[i, 1] - mean[1]) * axis[1]
                    + (points[i, 2] - mean[2]) * axis[2]
                )
                if along < margin:
                    order[m] = order[middle]
                    order[middle] = i
                    middle += 1
            begins[depth], ends[depth] = begin, middle
            begins[depth + 1], ends[depth + 1] = middle, end
            depth += 2
    return result, count


@kernel
def _mean_and_axis(
    points: Points, order: Labels, begin: int, end: int, mean: Points, axis: Points
) -> float:
    """Fill the mean and the longest axis of a run of rows; return the largest distance."""
    n = end - begin
    for a in range(3):
        mean[a] = 0.0
    for m in range(begin, end):
        for a in range(3):
            mean[a] += points[order[m], a]
    for a in range(3):
        mean[a] /= n
    xx = xy = xz = yy = yz = zz = 0.0
    farthest = 0.0
    for m in range(begin, end):
        x = points[order[m], 0] - mean[0]
        y = points[order[m], 1] - mean[1]
        z = points[order[m], 2] - mean[2]
        xx += x * x
        xy += x * y
        xz += x * z
        yy += y * y
        yz += y * z
        zz += z * z
        farthest = max(farthest, x * x + y * y + z * z)
    # Squaring the matrix six times is 64 power iterations; its columns then all point along the
    # longest axis, the one with the largest diagonal most surely.
    for _ in range(6):
        size = xx + yy + zz
        if size == 0.0:
            break
        xx, xy, xz, yy, yz, zz = xx / size, xy / size, xz / size, yy / size, yz / size, zz / size
        xx, xy, xz, yy, yz, zz = (
            xx * xx + xy * xy + xz * xz,
            xx * xy + xy * yy + xz * yz,
            xx * xz + xy * yz + xz * zz,
            xy * xy + yy * yy + yz * yz,
            xy * xz + yy * yz + yz * zz,
            xz * xz + yz * yz + zz * zz,
        )
    if xx >= yy and xx >= zz:
        axis[0], axis[1], axis[2] = xx, xy, xz
    elif yy >= zz:
        axis[0], axis[1], axis[2] = xy, yy, yz
    else:
        axis[0], axis[1], axis[2] = xz, yz, zz
    norm = math.sqrt(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2])
    if norm > 0.0:
        for a in range(3):
            axis[a] /= norm
    return math.sqrt(farthest)
