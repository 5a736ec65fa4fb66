"""Nearest points by a balanced k-d tree over points that are sorted into its leaves.

Node 0 holds all n points; a node that holds the rows from ``low`` to ``high`` is cut at
``(low + high) // 2`` across its widest side, its children are nodes ``2 i + 1`` and ``2 i + 2``,
and what is left after the last cut is a leaf. The ranges follow from n alone, so a tree is its
sorted points and, for each cut, an axis and a place.

A search walks down to the leaf of its query and puts the other sides of the cuts on a stack, with
their squared distance: that of the parent, with the offset across the cut instead of the
parent's own along that axis (Arya and Mount 1993).
"""

import math

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector
from scanlock.kernels._compile import kernel

_MOST_LEVELS = 64
"""Cuts on the way to a leaf, and so the most sides on the stack; 2^64 points have more."""

_STEPS_AHEAD = 3.0
"""How far beyond the nearest point others are looked for, in mean steps of the queries: what steps
that shrink from one to the next may still add up to."""


@kernel
def _place_middle(points: Points, order: Labels, low: int, high: int, axis: int) -> None:
    """Sort rows `low` to `high` so far that the middle one is in place along an axis (Hoare)."""
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
def sorted_into_leaves(points: Points, largest_leaf: int) -> tuple[Labels, Labels, Vector]:
    """Return the rows of the points in the order of the leaves, and the axis and place of cuts."""
    n = points.shape[0]
    levels = 0
    while (n >> levels) > largest_leaf:
        levels += 1
    cuts = (1 << levels) - 1
    order = np.arange(n)
    axes, places = np.zeros(cuts, np.int64), np.zeros(cuts)
    lows, highs = np.zeros(2 * cuts + 1, np.int64), np.zeros(2 * cuts + 1, np.int64)
    highs[0] = n
    for node in range(cuts):
        low, high = lows[node], highs[node]
        least0 = least1 = least2 = np.inf
        most0 = most1 = most2 = -np.inf
        for m in range(low, high):
            p = order[m]
            least0, most0 = min(least0, points[p, 0]), max(most0, points[p, 0])
            least1, most1 = min(least1, points[p, 1]), max(most1, points[p, 1])
            least2, most2 = min(least2, points[p, 2]), max(most2, points[p, 2])
        axis, width = 0, most0 - least0
        if most1 - least1 > width:
            axis, width = 1, most1 - least1
        if most2 - least2 > width:
            axis = 2
        _place_middle(points, order, low, high, axis)
        middle = (low + high) // 2
        axes[node], places[node] = axis, points[order[middle], axis]
        lows[2 * node + 1], highs[2 * node + 1] = low, middle
        lows[2 * node + 2], highs[2 * node + 2] = middle, high
    return order, axes, places


@kernel
def _walk_down(
    x0: float,
    x1: float,
    x2: float,
    axes: Labels,
    places: Vector,
    nodes: Labels,
    offsets: Matrix,
    top: int,
    limit: float,
) -> int:
    """Take the top side off the stack and walk to its leaf; return the new height of the stack.

    The range of the leaf is left in the row of `nodes` above the new top. A row of `nodes` is
    node, low, high; of `offsets`, the offset along each axis and the squared distance.
    """
    top -= 1
    node, low, high = nodes[top, 0], nodes[top, 1], nodes[top, 2]
    o0, o1, o2, squared = offsets[top, 0], offsets[top, 1], offsets[top, 2], offsets[top, 3]
    cuts = axes.shape[0]
    while node < cuts:
        axis = axes[node]
        middle = (low + high) // 2
        if axis == 0:
            across, own = x0 - places[node], o0
        elif axis == 1:
            across, own = x1 - places[node], o1
        else:
            across, own = x2 - places[node], o2
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


@kernel
def _nearest(
    points: Points, axes: Labels, places: Vector, x0: float, x1: float, x2: float,
    row: int, best: float, nodes: Labels, offsets: Matrix,
) -> tuple[int, float]:  # fmt: skip
    """Return the row of the nearest point and its squared distance, or those given if less."""
    nodes[0, 0], nodes[0, 1], nodes[0, 2] = 0, 0, points.shape[0]
    offsets[0, 0] = offsets[0, 1] = offsets[0, 2] = offsets[0, 3] = 0.0
    top = 1
    while top > 0:
        if offsets[top - 1, 3] >= best:
            top -= 1
            continue
        top = _walk_down(x0, x1, x2, axes, places, nodes, offsets, top, best)
        for p in range(nodes[top, 1], nodes[top, 2]):
            d0, d1, d2 = x0 - points[p, 0], x1 - points[p, 1], x2 - points[p, 2]
            squared = d0 * d0 + d1 * d1 + d2 * d2
            if squared < best:
                best, row = squared, p
    return row, best


@kernel
def nearest_rows(
    points: Points, axes: Labels, places: Vector, queries: Points, limit: float
) -> tuple[Labels, Vector]:
    """Return the sorted row of the point nearest to each query, and the distance [m].

    Only points nearer than `limit` [m]; -1 and Inf where there is none.
    """
    rows, distances = np.empty(queries.shape[0], np.int64), np.empty(queries.shape[0])
    nodes, offsets = np.zeros((_MOST_LEVELS, 3), np.int64), np.zeros((_MOST_LEVELS, 4))
    for i in range(queries.shape[0]):
        x0, x1, x2 = queries[i, 0], queries[i, 1], queries[i, 2]
        row, best = _nearest(points, axes, places, x0, x1, x2, -1, limit * limit, nodes, offsets)
        rows[i] = row
        distances[i] = math.sqrt(best) if row >= 0 else np.inf
    return rows, distances


@kernel
def several_nearest_rows(
    points: Points, axes: Labels, places: Vector, queries: Points, count: int
) -> Labels:
    """Return (m, count) the sorted rows of the points nearest to each query, nearest first.

    There must be at least `count` points.
    """
    rows = np.empty((queries.shape[0], count), np.int64)
    nearest = np.empty(count)
    nodes, offsets = np.zeros((_MOST_LEVELS, 3), np.int64), np.zeros((_MOST_LEVELS, 4))
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
            top = _walk_down(x0, x1, x2, axes, places, nodes, offsets, top, nearest[count - 1])
            for p in range(nodes[top, 1], nodes[top, 2]):
                d0, d1, d2 = x0 - points[p, 0], x1 - points[p, 1], x2 - points[p, 2]
                squared = d0 * d0 + d1 * d1 + d2 * d2
                if squared >= nearest[count - 1]:
                    continue
                place = count - 1
                while place > 0 and nearest[place - 1] > squared:
                    nearest[place] = nearest[place - 1]
                    rows[i, place] = rows[i, place - 1]
                    place -= 1
                nearest[place] = squared
                rows[i, place] = p
    return rows


@kernel
def _mean_distance(queries: Points, anchors: Points) -> float:
    """Return the mean distance [m] between rows; 0 without any."""
    total = 0.0
    for i in range(queries.shape[0]):
        d0, d1 = queries[i, 0] - anchors[i, 0], queries[i, 1] - anchors[i, 1]
        d2 = queries[i, 2] - anchors[i, 2]
        total += math.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
    return total / max(1, queries.shape[0])


@kernel
def _distance(points: Points, row: int, x0: float, x1: float, x2: float) -> float:
    """Return how far a place lies from a point [m]; infinite for row -1."""
    if row < 0:
        return np.inf
    d0, d1, d2 = x0 - points[row, 0], x1 - points[row, 1], x2 - points[row, 2]
    return math.sqrt(d0 * d0 + d1 * d1 + d2 * d2)


@kernel
def _wider(squared: float, slack: float, most: float) -> float:
    """Return the square of a distance plus a slack, at most `most`."""
    wider = math.sqrt(squared) + slack
    return min(most, wider * wider)


@kernel
def _nearest_and_bound(
    points: Points, axes: Labels, places: Vector, x0: float, x1: float, x2: float,
    row: int, distance: float, slack: float, nodes: Labels, offsets: Matrix,
) -> tuple[int, float, float]:  # fmt: skip
    """Return the row of the nearest point, its distance, and a bound on that of any other.

    Others are at the bound or farther; it is at most `slack` more than the distance. A row and
    its distance are the first guess, or -1 and a distance beyond which no point counts.
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
        top = _walk_down(x0, x1, x2, axes, places, nodes, offsets, top, others)
        for p in range(nodes[top, 1], nodes[top, 2]):
            d0, d1, d2 = x0 - points[p, 0], x1 - points[p, 1], x2 - points[p, 2]
            squared = d0 * d0 + d1 * d1 + d2 * d2
            if squared >= others or p == row:
                continue
            if squared < best:
                others = _wider(squared, slack, min(best, others))
                best, row = squared, p
            else:
                others = squared
    return row, math.sqrt(best), math.sqrt(others)


@kernel
def kept_nearest_rows(
    points: Points, axes: Labels, places: Vector, queries: Points, limit: float,
    typical: float, anchors: Points, kept: Labels, bounds: Vector,
) -> tuple[Labels, Vector, float]:  # fmt: skip
    """Return what `nearest_rows` does, for queries that move little, and the mean distance.

    A query that was at `anchors` had the point `kept` nearest, and no other within `bounds` [m].
    From a place that far off, less the way it moved, it still has not: only where that says too
    little is the tree searched, and the three are written anew. A bound of -Inf says nothing.
    `typical` is the mean distance of the search before [m].
    """
    rows, distances = np.empty(queries.shape[0], np.int64), np.empty(queries.shape[0])
    nodes, offsets = np.zeros((_MOST_LEVELS, 3), np.int64), np.zeros((_MOST_LEVELS, 4))
    slack = _STEPS_AHEAD * _mean_distance(queries, anchors)
    if slack > typical:
        # Steps so long leave no point the nearest, and to look further than it would be in vain.
        slack = 0.0
    total, met = 0.0, 0
    for i in range(queries.shape[0]):
        x0, x1, x2 = queries[i, 0], queries[i, 1], queries[i, 2]
        row = kept[i]
        distance = _distance(points, row, x0, x1, x2)
        clear = bounds[i] - _distance(anchors, i, x0, x1, x2)
        if not min(distance, limit) < clear:
            if distance >= limit:
                row, distance = -1, limit
            if slack == 0.0:
                row, best = _nearest(
                    points, axes, places, x0, x1, x2, row, distance * distance, nodes, offsets
                )
                distance = bound = math.sqrt(best)
            else:
                row, distance, bound = _nearest_and_bound(
                    points, axes, places, x0, x1, x2, row, distance, slack, nodes,
                    offsets,
                )  # fmt: skip
            anchors[i, 0], anchors[i, 1], anchors[i, 2] = x0, x1, x2
            kept[i], bounds[i] = row, bound
        is_near = distance < limit
        rows[i] = row if is_near else -1
        distances[i] = distance if is_near else np.inf
        total += distance if is_near else 0.0
        met += is_near
    return rows, distances, total / max(1, met)
