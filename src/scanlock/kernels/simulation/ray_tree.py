"""Bounding volume hierarchy, so that a ray is tested against few surfaces instead of all."""

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Labels, Matrix, Vector
from scanlock.kernels._compile import helper, kernel

_BINS = 16
_LEAF = 4


@kernel
def box_tree(bounds: Matrix) -> tuple[Labels, Matrix, Labels, Labels]:
    """Return order, node bounds, node link and node count of a tree over (n, 6) boxes.

    A box is (low x, y, z, high x, y, z) [m]. Nodes are in preorder: the left child of node k is
    k + 1. A leaf has a positive count, and its boxes are ``order[link : link + count]``; an
    inner node has count 0, and its link is its right child. Splits follow the surface-area
    heuristic over 16 bins per axis (Wald 2007, "On fast construction of SAH-based bounding
    volume hierarchies").
    """
    n = bounds.shape[0]
    order = np.arange(n)
    node_bounds = np.empty((max(2 * n - 1, 0), 6))
    link = np.zeros(node_bounds.shape[0], np.int64)
    count = np.zeros(node_bounds.shape[0], np.int64)
    # Each entry is a range of `order`, and the parent if the range is its right child.
    begins = np.empty(n + 1, np.int64)
    ends = np.empty(n + 1, np.int64)
    parents = np.empty(n + 1, np.int64)
    depth = 0
    if n > 0:
        begins[0], ends[0], parents[0] = 0, n, -1
        depth = 1
    nodes = 0
    centres = np.empty(6)
    while depth > 0:
        depth -= 1
        begin, end, parent = begins[depth], ends[depth], parents[depth]
        node = nodes
        nodes += 1
        if parent >= 0:
            link[parent] = node
        _enclose(bounds, order, begin, end, node_bounds[node], centres)
        if end - begin <= _LEAF:
            link[node] = begin
            count[node] = end - begin
            continue
        axis, middle = _best_split(bounds, order, begin, end, centres)
        cut = begin
        for k in range(begin, end):
            box = order[k]
            if bounds[box, axis] + bounds[box, axis + 3] < middle:
                order[k] = order[cut]
                order[cut] = box
                cut += 1
        if cut in (begin, end):
            # All centres coincide: any halves will do.
            cut = (begin + end) // 2
        begins[depth], ends[depth], parents[depth] = cut, end, node
        begins[depth + 1], ends[depth + 1], parents[depth + 1] = begin, cut, -1
        depth += 2
    return order, node_bounds[:nodes].copy(), link[:nodes].copy(), count[:nodes].copy()


@helper
def _enclose(
    bounds: Matrix, order: Labels, begin: int, end: int, box: Vector, centres: Vector
) -> None:
    """Write the bounding box of boxes, and the bounding box of their doubled centres."""
    for a in range(3):
        box[a] = np.inf
        box[a + 3] = -np.inf
        centres[a] = np.inf
        centres[a + 3] = -np.inf
    for k in range(begin, end):
        i = order[k]
        for a in range(3):
            low, high = bounds[i, a], bounds[i, a + 3]
            box[a] = min(box[a], low)
            box[a + 3] = max(box[a + 3], high)
            centres[a] = min(centres[a], low + high)
            centres[a + 3] = max(centres[a + 3], low + high)


@helper
def _best_split(
    bounds: Matrix, order: Labels, begin: int, end: int, centres: Vector
) -> tuple[int, float]:
    """Return axis and doubled centre of the split of minimum cost; boxes below it go left."""
    best_axis, best_middle, best_cost = 0, -np.inf, np.inf
    counts = np.empty(_BINS, np.int64)
    boxes = np.empty((_BINS, 6))
    left_costs = np.empty(_BINS)
    for axis in range(3):
        low = centres[axis]
        width = (centres[axis + 3] - low) / _BINS
        if not width > 0.0:
            continue
        counts[:] = 0
        boxes[:, :3] = np.inf
        boxes[:, 3:] = -np.inf
        for k in range(begin, end):
            i = order[k]
            b = min(int((bounds[i, axis] + bounds[i, axis + 3] - low) / width), _BINS - 1)
            counts[b] += 1
            for a in range(3):
                boxes[b, a] = min(boxes[b, a], bounds[i, a])
                boxes[b, a + 3] = max(boxes[b, a + 3], bounds[i, a + 3])
        _sweep(boxes, counts, left_costs, 0, 1)
        cost_right = np.empty(_BINS)
        _sweep(boxes, counts, cost_right, _BINS - 1, -1)
        for b in range(1, _BINS):
            cost = left_costs[b - 1] + cost_right[b]
            if cost < best_cost:
                best_axis, best_middle, best_cost = axis, low + b * width, cost
    return best_axis, best_middle


@helper
def _sweep(
    boxes: Matrix, counts: NDArray[np.int64], costs: Vector, first: int, direction: int
) -> None:
    """Write the cost (half surface times count) of the bins from `first` up to each one."""
    low_x, low_y, low_z = np.inf, np.inf, np.inf
    high_x, high_y, high_z = -np.inf, -np.inf, -np.inf
    count = 0
    for step in range(_BINS):
        b = first + direction * step
        count += counts[b]
        low_x, high_x = min(low_x, boxes[b, 0]), max(high_x, boxes[b, 3])
        low_y, high_y = min(low_y, boxes[b, 1]), max(high_y, boxes[b, 4])
        low_z, high_z = min(low_z, boxes[b, 2]), max(high_z, boxes[b, 5])
        if count == 0:
            costs[b] = 0.0
            continue
        x, y, z = high_x - low_x, high_y - low_y, high_z - low_z
        costs[b] = count * (x * y + y * z + z * x)
