"""Clustering of points: numbering of occupied cells, adjacency and connected components."""

import numpy as np

from scanlock.arrays import Labels, Mask, Points
from scanlock.kernels._compile import kernel


@kernel
def occupied_cells(cells: Labels, cell_count: int) -> tuple[Labels, Labels]:
    """Return the occupied cells in ascending order, and the label of each point.

    Parameters
    ----------
    cells : (n,)
        Cell of each point in [0, cell_count); negative for none.
    cell_count : int

    Returns
    -------
    labels : (n,)
        Number of each point's cell; -1 for none.
    occupied : (k,)
        Cell of each number.
    """
    label_of_cell = np.full(cell_count, -1, np.int64)
    for i in range(cells.shape[0]):
        if cells[i] >= 0:
            label_of_cell[cells[i]] = 0
    count = 0
    for c in range(cell_count):
        if label_of_cell[c] == 0:
            label_of_cell[c] = count
            count += 1
    labels = np.full(cells.shape[0], -1, np.int64)
    for i in range(cells.shape[0]):
        if cells[i] >= 0:
            labels[i] = label_of_cell[cells[i]]
    occupied = np.empty(count, np.int64)
    for c in range(cell_count):
        if label_of_cell[c] >= 0:
            occupied[label_of_cell[c]] = c
    return labels, occupied


@kernel
def adjacent_cells(occupied: Labels, sectors: int, bins: int) -> tuple[Labels, Labels]:
    """Return the pairs of rows of occupied polar cells that share an edge or a corner, each once.

    `occupied` (k,) is ascending; cell = ``sector * bins + bin``. Sectors wrap around, bins do not.
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
            # Outwards, then the three of the next sector; the other four find this one likewise.
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
def are_close(points: Points, first: Labels, second: Labels, max_distance: float) -> Mask:
    """Return whether the points of each pair of rows are closer than a distance [m]."""
    close = np.empty(first.shape[0], np.bool_)
    for m in range(first.shape[0]):
        a, b = first[m], second[m]
        dx = points[a, 0] - points[b, 0]
        dy = points[a, 1] - points[b, 1]
        dz = points[a, 2] - points[b, 2]
        close[m] = dx * dx + dy * dy + dz * dz < max_distance * max_distance
    return close


@kernel
def relabelled(labels: Labels, new_labels: Labels) -> Labels:
    """Return ``new_labels[label]`` for each label; -1 stays -1."""
    found = np.empty(labels.shape[0], np.int64)
    for i in range(labels.shape[0]):
        found[i] = new_labels[labels[i]] if labels[i] >= 0 else -1
    return found


@kernel
def connected_components(
    rows: int, first: Labels, second: Labels, is_edge: Mask
) -> tuple[Labels, int]:
    """Return the component of each row of a graph and the number of components, by union-find.

    The edges are those pairs of rows ``first[m], second[m]`` for which `is_edge` holds.
    Components are numbered by their first rows.
    """
    root = np.arange(rows)
    for m in range(first.shape[0]):
        if not is_edge[m]:
            continue
        a, b = first[m], second[m]
        while root[a] != a:
            root[a] = root[root[a]]
            a = root[a]
        while root[b] != b:
            root[b] = root[root[b]]
            b = root[b]
        # The smaller row becomes the root, so every row comes after its root.
        root[max(a, b)] = min(a, b)
    component = np.empty(rows, np.int64)
    count = 0
    for k in range(rows):
        if root[k] == k:
            component[k] = count
            count += 1
        else:
            component[k] = component[root[k]]
    return component, count
