"""Grouping of points: numbering of occupied cells, and what of them is connected."""

import numpy as np

from scanlock.arrays import Labels, Mask, Points
from scanlock.kernels._compile import kernel


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
def touching_cells(occupied: Labels, sectors: int, bins: int) -> tuple[Labels, Labels]:
    """Return each pair of occupied polar cells that share an edge or a corner, once, by rows.

    `occupied` (k,) is ascending; cell ``sector * bins + bin``. Sectors wrap around, bins do not.
    """
    row_of_cell = np.full(sectors * bins, -1, np.int64)
    for k in range(occupied.shape[0]):
        row_of_cell[occupied[k]] = k
    first = np.empty(4 * occupied.shape[0], np.int64)
    second = np.empty(4 * occupied.shape[0], np.int64)
    found = 0
    for k in range(occupied.shape[0]):
        sector = occupied[k] // bins
        ring = occupied[k] % bins
        for step in range(4):
            # Outwards, then the three of the next sector; the other four see this one so.
            other_sector = sector if step == 0 else (sector + 1) % sectors
            other_ring = ring + 1 if step == 0 else ring + step - 2
            if other_ring < 0 or other_ring >= bins:
                continue
            other = row_of_cell[other_sector * bins + other_ring]
            if other >= 0:
                first[found] = k
                second[found] = other
                found += 1
    return first[:found].copy(), second[:found].copy()


@kernel
def close_pairs(points: Points, first: Labels, second: Labels, limit: float) -> Mask:
    """Return whether the points of each pair of rows are less than a limit apart."""
    are_close = np.empty(first.shape[0], np.bool_)
    for m in range(first.shape[0]):
        a, b = first[m], second[m]
        dx = points[a, 0] - points[b, 0]
        dy = points[a, 1] - points[b, 1]
        dz = points[a, 2] - points[b, 2]
        are_close[m] = dx * dx + dy * dy + dz * dz < limit * limit
    return are_close


@kernel
def regrouped(labels: Labels, groups: Labels) -> Labels:
    """Return the group of each row, given that of each label; -1 stays -1."""
    found = np.empty(labels.shape[0], np.int64)
    for i in range(labels.shape[0]):
        found[i] = groups[labels[i]] if labels[i] >= 0 else -1
    return found


@kernel
def joined_groups(rows: int, first: Labels, second: Labels, joins: Mask) -> tuple[Labels, int]:
    """Return the group of each row when the pairs that join are in one, and how many there are.

    Groups are numbered by their first rows.
    """
    root = np.arange(rows)
    for m in range(first.shape[0]):
        if not joins[m]:
            continue
        a, b = first[m], second[m]
        while root[a] != a:
            root[a] = root[root[a]]
            a = root[a]
        while root[b] != b:
            root[b] = root[root[b]]
            b = root[b]
        # The smaller row leads, so every row comes after the one that leads it.
        root[max(a, b)] = min(a, b)
    group = np.empty(rows, np.int64)
    count = 0
    for k in range(rows):
        if root[k] == k:
            group[k] = count
            count += 1
        else:
            group[k] = group[root[k]]
    return group, count
