"""Nearest neighbours by a balanced k-d tree whose points are sorted by leaf.

Node 0 holds all n points. A node with the rows from ``low`` to ``high`` is split at
``(low + high) // 2`` across its widest side, its children are nodes ``2 i + 1`` and ``2 i + 2``,
and the nodes after the last split are leaves. The ranges of rows follow from n alone, so a tree is
its sorted points and, for each split, an axis and a coordinate.

A search descends to the leaf of its query and pushes the other sides of the splits on a stack with
their squared distances. The squared distance of a side is that of its parent, with the offset
along the split axis replaced (Arya and Mount 1993).
"""

import math

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector
from scanlock.kernels._compile import helper, kernel

_MAX_LEVELS = 64
"""Largest number of splits above a leaf, and so of sides on the stack; 2^64 points have more."""

_STEPS_AHEAD = 3.0
"""Distance beyond the nearest point within which others are searched, in mean steps of the
queries: a bound on the sum of further steps, if they shrink."""


@helper
def _select_median(points: Points, order: Labels, low: int, high: int, axis: int) -> None:
    """Partition rows `low` to `high` about their median along an axis (Hoare's quickselect)."""
    middle = (low + high) // 2
    left, right = low, high - 1
    while left < right:
        first, last = points[order[left], axis], points[order[right], axis]
        inner = points[order[(left + right) // 2], axis]
        pivot = max(min(first, last), min(max(first, last), inner))
        i, j = left, right
        while i <= j:
            while points[order[i], axis] < pivot:
                i += 1
            while points[order[j], axis] > pivot:
                j -= 1
            if i <= j:
                order[i], order[j] = order[j], order[i]
                i += 1
                j -= 1
        if middle <= j:
            right = j
        elif middle >= i:
            left = i
        else:
            return


@kernel
def build_kd_tree(points: Points, max_leaf_size: int) -> tuple[Labels, Labels, Vector]:
    """Return the rows of (n, 3) points in the order of the leaves, and the tree's splits.

    Returns
    -------
    order : (n,)
    axes : (splits,)
        Axis of each split.
    coordinates : (splits,) [m]
        Coordinate of each split along its axis.
    """
    n = points.shape[0]
    levels = 0
    while (n >> levels) > max_leaf_size:
        levels += 1
    splits = (1 << levels) - 1
    order = np.arange(n)
    axes, coordinates = np.zeros(splits, np.int64), np.zeros(splits)
    lows, highs = np.zeros(2 * splits + 1, np.int64), np.zeros(2 * splits + 1, np.int64)
    highs[0] = n
    for node in range(splits):
        low, high = lows[node], highs[node]
        min0 = min1 = min2 = np.inf
        max0 = max1 = max2 = -np.inf
        for m in range(low, high):
            p = order[m]
            min0, max0 = min(min0, points[p, 0]), max(max0, points[p, 0])
            min1, max1 = min(min1, points[p, 1]), max(max1, points[p, 1])
            min2, max2 = min(min2, points[p, 2]), max(max2, points[p, 2])
        axis, width = 0, max0 - min0
        if max1 - min1 > width:
            axis, width = 1, max1 - min1
        if max2 - min2 > width:
            axis = 2
        _select_median(points, order, low, high, axis)
        middle = (low + high) // 2
        axes[node], coordinates[node] = axis, points[order[middle], axis]
        lows[2 * node + 1], highs[2 * node + 1] = low, middle
        lows[2 * node + 2], highs[2 * node + 2] = middle, high
    return order, axes, coordinates


@helper
def _descend(
    x0: float,
    x1: float,
    x2: float,
    axes: Labels,
    coordinates: Vector,
    nodes: Labels,
    offsets: Matrix,
    top: int,
    limit: float,
) -> int:
    """Pop a side from the stack and descend to its leaf; return the new height of the stack.

    The rows of the leaf are left in the row of `nodes` above the new top. A row of `nodes` is
    (node, low, high); a row of `offsets` is the offset along each axis and the squared distance.
    """
    top -= 1
    node, low, high = nodes[top, 0], nodes[top, 1], nodes[top, 2]
    o0, o1, o2, squared = offsets[top, 0], offsets[top, 1], offsets[top, 2], offsets[top, 3]
    splits = axes.shape[0]
    while node < splits:
        axis = axes[node]
        middle = (low + high) // 2
        if axis == 0:
            across, own = x0 - coordinates[node], o0
        elif axis == 1:
            across, own = x1 - coordinates[node], o1
        else:
            across, own = x2 - coordinates[node], o2
        far = squared - own * own + across * across
        below = across < 0.0
        if far < limit:
            offsets[top, 0], offsets[top, 1], offsets[top, 2] = o0, o1, o2
            offsets[top, axis] = across
            offsets[top, 3] = far
            if below:
                nodes[top, 0], nodes[top, 1], nodes[top, 2] = 2 * node + 2, middle, high
            else:
                nodes[top, 0], nodes[top, 1], nodes[top, 2] = 2 * node + 1, low, middle
            top += 1
        if below:
            node, high = 2 * node + 1, middle
        else:
            node, low = 2 * node + 2, middle
    nodes[top, 1], nodes[top, 2] = low, high
    return top


@helper
def _nearest(
    points: Points, axes: Labels, coordinates: Vector, x0: float, x1: float, x2: float,
    row: int, best: float, nodes: Labels, offsets: Matrix,
) -> tuple[int, float]:  # fmt: skip
    """Return the row and squared distance of the nearest point, or the given ones if nearer."""
    nodes[0, 0], nodes[0, 1], nodes[0, 2] = 0, 0, points.shape[0]
    offsets[0, 0] = offsets[0, 1] = offsets[0, 2] = offsets[0, 3] = 0.0
    top = 1
    while top > 0:
        if offsets[top - 1, 3] >= best:
            top -= 1
            continue
        top = _descend(x0, x1, x2, axes, coordinates, nodes, offsets, top, best)
        for p in range(nodes[top, 1], nodes[top, 2]):
            d0, d1, d2 = x0 - points[p, 0], x1 - points[p, 1], x2 - points[p, 2]
            squared = d0 * d0 + d1 * d1 + d2 * d2
            if squared < best:
                best, row = squared, p
    return row, best


@kernel
def nearest_neighbours(
    points: Points, axes: Labels, coordinates: Vector, queries: Points, max_distance: float
) -> tuple[Labels, Vector]:
    """Return the sorted row of the point nearest to each query (m, 3), and the distance [m].

    They are -1 and Inf if no point is nearer than `max_distance` [m].
    """
    rows, distances = np.empty(queries.shape[0], np.int64), np.empty(queries.shape[0])
    nodes, offsets = np.zeros((_MAX_LEVELS, 3), np.int64), np.zeros((_MAX_LEVELS, 4))
    max_squared = max_distance * max_distance
    for i in range(queries.shape[0]):
        x0, x1, x2 = queries[i, 0], queries[i, 1], queries[i, 2]
        row, best = _nearest(points, axes, coordinates, x0, x1, x2, -1, max_squared, nodes, offsets)
        rows[i] = row
        distances[i] = math.sqrt(best) if row >= 0 else np.inf
    return rows, distances


@kernel
def k_nearest_neighbours(
    points: Points, axes: Labels, coordinates: Vector, queries: Points, count: int
) -> Labels:
    """Return the (m, count) sorted rows of the points nearest to each query, nearest first.

    There must be at least `count` points.
    """
    rows = np.empty((queries.shape[0], count), np.int64)
    nearest = np.empty(count)
    nodes, offsets = np.zeros((_MAX_LEVELS, 3), np.int64), np.zeros((_MAX_LEVELS, 4))
    for i in range(queries.shape[0]):
        x0, x1, x2 = queries[i, 0], queries[i, 1], queries[i, 2]
        nearest[:] = np.inf
        nodes[0, 0], nodes[0, 1], nodes[0, 2] = 0, 0, points.shape[0]
        offsets[0, 0] = offsets[0, 1] = offsets[0, 2] = offsets[0, 3] = 0.0
        top = 1
        while top > 0:
            if offsets[top - 1, 3] >= nearest[count - 1]:
                top -= 1
                continue
            top = _descend(x0, x1, x2, axes, coordinates, nodes, offsets, top, nearest[count - 1])
            for p in range(nodes[top, 1], nodes[top, 2]):
                d0, d1, d2 = x0 - points[p, 0], x1 - points[p, 1], x2 - points[p, 2]
                squared = d0 * d0 + d1 * d1 + d2 * d2
                if squared >= nearest[count - 1]:
                    continue
                k = count - 1
                while k > 0 and nearest[k - 1] > squared:
                    nearest[k] = nearest[k - 1]
                    rows[i, k] = rows[i, k - 1]
                    k -= 1
                nearest[k] = squared
                rows[i, k] = p
    return rows


@helper
def _mean_distance(queries: Points, anchors: Points) -> float:
    """Return the mean distance [m] between equal rows; 0 if there are none."""
    total = 0.0
    for i in range(queries.shape[0]):
        d0, d1 = queries[i, 0] - anchors[i, 0], queries[i, 1] - anchors[i, 1]
        d2 = queries[i, 2] - anchors[i, 2]
        total += math.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
    return total / max(1, queries.shape[0])


@helper
def _distance(points: Points, row: int, x0: float, x1: float, x2: float) -> float:
    """Return the distance [m] of a query from a point; infinite for row -1."""
    if row < 0:
        return np.inf
    d0, d1, d2 = x0 - points[row, 0], x1 - points[row, 1], x2 - points[row, 2]
    return math.sqrt(d0 * d0 + d1 * d1 + d2 * d2)


@helper
def _extended(squared: float, slack: float, max_squared: float) -> float:
    """Return the square of a distance plus a slack, at most `max_squared`."""
    distance = math.sqrt(squared) + slack
    return min(max_squared, distance * distance)


@helper
def _nearest_and_bound(
    points: Points, axes: Labels, coordinates: Vector, x0: float, x1: float, x2: float,
    row: int, distance: float, slack: float, nodes: Labels, offsets: Matrix,
) -> tuple[int, float, float]:  # fmt: skip
    """Return the row and distance of the nearest point, and a lower bound for all other points.

    The bound is at most `slack` more than the distance. The given row and its distance are the
    first guess; row -1 gives a distance beyond which points do not count.
    """
    best = distance * distance
    others = (distance + slack) ** 2
    nodes[0, 0], nodes[0, 1], nodes[0, 2] = 0, 0, points.shape[0]
    offsets[0, 0] = offsets[0, 1] = offsets[0, 2] = offsets[0, 3] = 0.0
    top = 1
    while top > 0:
        if offsets[top - 1, 3] >= others:
            top -= 1
            continue
        top = _descend(x0, x1, x2, axes, coordinates, nodes, offsets, top, others)
        for p in range(nodes[top, 1], nodes[top, 2]):
            d0, d1, d2 = x0 - points[p, 0], x1 - points[p, 1], x2 - points[p, 2]
            squared = d0 * d0 + d1 * d1 + d2 * d2
            if squared >= others or p == row:
                continue
            if squared < best:
                others = _extended(squared, slack, min(best, others))
                best, row = squared, p
            else:
                others = squared
    return row, math.sqrt(best), math.sqrt(others)


@kernel
def cached_nearest_neighbours(
    points: Points, axes: Labels, coordinates: Vector, queries: Points, max_distance: float,
    mean_distance: float, anchors: Points, cached: Labels, bounds: Vector,
) -> tuple[Labels, Vector, float]:  # fmt: skip
    """Return the result of `nearest_neighbours` for queries that move little between calls.

    When a query was at its anchor, its nearest point was `cached`, and all others were at its
    bound or farther. So they are still at the bound less the distance from the anchor, or
    farther. The tree is searched, and the three are updated, only if another point can be nearest.

    Parameters
    ----------
    points, axes, coordinates
        Tree of `build_kd_tree`, with its points sorted.
    queries : (m, 3) [m]
    max_distance : float [m]
    mean_distance : float [m]
        That of the previous call.
    anchors, cached, bounds : (m, 3) [m], (m,), (m,) [m]
        Updated in place; a bound of -Inf forces a search.

    Returns
    -------
    rows : (m,)
        -1 if no point is nearer than `max_distance`.
    distances : (m,) [m]
        Inf if no point is nearer.
    mean_distance : float [m]
    """
    rows, distances = np.empty(queries.shape[0], np.int64), np.empty(queries.shape[0])
    nodes, offsets = np.zeros((_MAX_LEVELS, 3), np.int64), np.zeros((_MAX_LEVELS, 4))
    slack = _STEPS_AHEAD * _mean_distance(queries, anchors)
    if slack > mean_distance:
        # After steps this long another point is nearest, so a bound would not be used.
        slack = 0.0
    total, count = 0.0, 0
    for i in range(queries.shape[0]):
        x0, x1, x2 = queries[i, 0], queries[i, 1], queries[i, 2]
        row = cached[i]
        distance = _distance(points, row, x0, x1, x2)
        clear = bounds[i] - _distance(anchors, i, x0, x1, x2)
        if not min(distance, max_distance) < clear:
            if distance >= max_distance:
                row, distance = -1, max_distance
            if slack == 0.0:
                row, best = _nearest(
                    points, axes, coordinates, x0, x1, x2, row, distance * distance, nodes, offsets
                )
                distance = bound = math.sqrt(best)
            else:
                row, distance, bound = _nearest_and_bound(
                    points, axes, coordinates, x0, x1, x2, row, distance, slack, nodes,
                    offsets,
                )  # fmt: skip
            anchors[i, 0], anchors[i, 1], anchors[i, 2] = x0, x1, x2
            cached[i], bounds[i] = row, bound
        is_near = distance < max_distance
        rows[i] = row if is_near else -1
        distances[i] = distance if is_near else np.inf
        total += distance if is_near else 0.0
        count += is_near
    return rows, distances, total / max(1, count)
