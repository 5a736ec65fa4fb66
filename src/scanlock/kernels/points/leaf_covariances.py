"""Covariances of the k nearest neighbours of each point, one leaf of a k-d tree at a time.

Points of a leaf are close together and have most neighbours in common. All points around the leaf
are gathered once. The k nearest of a point are those within a distance that contains exactly k, so
no list is sorted and every loop uses vector units. The layout of the tree is that of
`kernels/points/point_tree.py`.
"""

import math

import numpy as np

from scanlock.arrays import Labels, Mask, Matrix, Points, Vector
from scanlock.kernels._compile import helper, kernel, sum_helper

_MAX_LEVELS = 64
"""Largest number of splits above a leaf, and so of nodes on the stack; 2^64 points have more."""

_CAPACITY = 1024
"""Points that can be gathered around a leaf; leaves with more are left out."""

_FIRST_RADIUS = 0.5
"""Radius of the first search around a leaf, in diagonals of the leaf; the second uses 1."""

_MAX_TRIALS = 24
"""Distances that are tried; more are needed only for neighbours at equal distances."""


@helper
def _range_of(node: int, count: int) -> tuple[int, int]:
    """Return the first row of a node of a tree of `count` points, and the row after the last."""
    path, levels = node + 1, 0
    while (path >> levels) > 1:
        levels += 1
    low, high = 0, count
    for level in range(levels - 1, -1, -1):
        middle = (low + high) // 2
        if (path >> level) & 1:
            low = middle
        else:
            high = middle
    return low, high


@helper
def _box_of(points: Points, low: int, high: int, box: Matrix) -> float:
    """Write the smallest and largest coordinates (2, 3) of some rows; return the diagonal."""
    box[0], box[1] = np.inf, -np.inf
    for p in range(low, high):
        for axis in range(3):
            box[0, axis] = min(box[0, axis], points[p, axis])
            box[1, axis] = max(box[1, axis], points[p, axis])
    d0, d1, d2 = box[1, 0] - box[0, 0], box[1, 1] - box[0, 1], box[1, 2] - box[0, 2]
    return math.sqrt(d0 * d0 + d1 * d1 + d2 * d2)


@helper
def _gather(
    points: Points, axes: Labels, splits: Vector, box: Matrix, radius: float, nodes: Labels,
    around: Matrix,
) -> int:  # fmt: skip
    """Copy the points within a radius of a box, along each axis; return their number.

    The number exceeds the capacity if points were left out.
    """
    min0, min1, min2 = box[0, 0] - radius, box[0, 1] - radius, box[0, 2] - radius
    max0, max1, max2 = box[1, 0] + radius, box[1, 1] + radius, box[1, 2] + radius
    nodes[0, 0], nodes[0, 1], nodes[0, 2] = 0, 0, points.shape[0]
    top, found = 1, 0
    while top > 0:
        top -= 1
        node, low, high = nodes[top, 0], nodes[top, 1], nodes[top, 2]
        if node < axes.shape[0]:
            axis, middle = axes[node], (low + high) // 2
            if box[1, axis] + radius >= splits[node]:
                nodes[top, 0], nodes[top, 1], nodes[top, 2] = 2 * node + 2, middle, high
                top += 1
            if box[0, axis] - radius <= splits[node]:
                nodes[top, 0], nodes[top, 1], nodes[top, 2] = 2 * node + 1, low, middle
                top += 1
            continue
        if found + high - low > _CAPACITY:
            return _CAPACITY + 1
        for p in range(low, high):
            x, y, z = points[p, 0], points[p, 1], points[p, 2]
            around[0, found], around[1, found], around[2, found] = x, y, z
            found += (
                (x >= min0) & (x <= max0) & (y >= min1) & (y <= max1)
                & (z >= min2) & (z <= max2)
            )  # fmt: skip
    return found


@sum_helper
def _count_within(squares: Vector, limit: float) -> float:
    """Return the number of squared distances up to a limit."""
    found = 0.0
    for p in range(squares.shape[0]):
        found += 1.0 if squares[p] <= limit else 0.0
    return found


@helper
def _limit_for(squares: Vector, count: int, max_square: float, guess: float) -> float:
    """Return a limit that exactly `count` squared distances are within, or -1 if none is found.

    The limit is at most `max_square`. On a surface the number within a limit is proportional to
    the limit, so it is found by regula falsi.
    """
    low, count_low, high, count_high = 0.0, 0.0, max_square, -1.0
    limit = min(guess, max_square)
    for trial in range(_MAX_TRIALS):
        found = _count_within(squares, limit)
        if found == count:
            return limit
        if found > count:
            high, count_high = limit, found
        else:
            low, count_low = limit, found
            if count_high < 0.0:
                count_high = _count_within(squares, max_square)
                if count_high <= count:
                    return max_square if count_high == count else -1.0
        # Every fourth trial bisects.
        ratio = (count + 0.5 - count_low) / (count_high - count_low) if trial % 4 < 3 else 0.5
        limit = low + ratio * (high - low)
    return -1.0


@sum_helper
def _covariance_within(
    x: Vector, y: Vector, z: Vector, squares: Vector, limit: float,
    x0: float, x1: float, x2: float, count: int, covariance: Vector,
) -> None:  # fmt: skip
    """Write the packed covariance of the points up to a squared distance from a point."""
    sx = sy = sz = xx = xy = xz = yy = yz = zz = 0.0
    for p in range(squares.shape[0]):
        weight = 1.0 if squares[p] <= limit else 0.0
        d0, d1, d2 = weight * (x[p] - x0), weight * (y[p] - x1), weight * (z[p] - x2)
        sx += d0
        sy += d1
        sz += d2
        xx += d0 * d0
        xy += d0 * d1
        xz += d0 * d2
        yy += d1 * d1
        yz += d1 * d2
        zz += d2 * d2
    scale = 1.0 / count
    sx, sy, sz = scale * sx, scale * sy, scale * sz
    covariance[0], covariance[1] = scale * xx - sx * sx, scale * xy - sx * sy
    covariance[2], covariance[3] = scale * xz - sx * sz, scale * yy - sy * sy
    covariance[4], covariance[5] = scale * yz - sy * sz, scale * zz - sz * sz


@helper
def _fill_leaf(
    points: Points, begin: int, end: int, x: Vector, y: Vector, z: Vector, squares: Vector,
    count: int, max_square: float, covariances: Matrix, is_known: Mask,
) -> None:  # fmt: skip
    """Write the covariances of the points of a leaf whose neighbours are all among x, y, z."""
    limit = 0.5 * max_square
    for q in range(begin, end):
        if is_known[q]:
            continue
        x0, x1, x2 = points[q, 0], points[q, 1], points[q, 2]
        for p in range(x.shape[0]):
            d0, d1, d2 = x[p] - x0, y[p] - x1, z[p] - x2
            squares[p] = d0 * d0 + d1 * d1 + d2 * d2
        found = _limit_for(squares, count, max_square, limit)
        if found >= 0.0:
            limit = found
            _covariance_within(x, y, z, squares, limit, x0, x1, x2, count, covariances[q])
            is_known[q] = True


@kernel
def knn_covariances(
    points: Points, axes: Labels, splits: Vector, count: int
) -> tuple[Matrix, Mask]:
    """Return the covariance of the nearest neighbours of each point, and which are known.

    A covariance is unknown if neighbours are far beyond the leaf of the point, or if several
    points are equally far and not all of them are among the nearest.

    Parameters
    ----------
    points, axes, splits
        Tree of `point_tree.build_kd_tree`: its sorted points (n, 3) [m], and the axis and
        coordinate of each split.
    count : int
        Number of neighbours of a point, itself included.

    Returns
    -------
    covariances : (n, 6) [m^2]
        Packed as xx, xy, xz, yy, yz, zz and divided by `count`.
    is_known : (n,)
    """
    n, first = points.shape[0], axes.shape[0]
    covariances, is_known = np.zeros((n, 6)), np.zeros(n, np.bool_)
    nodes, box = np.empty((_MAX_LEVELS, 3), np.int64), np.empty((2, 3))
    around, squares = np.empty((3, _CAPACITY + 1)), np.empty(_CAPACITY)
    for leaf in range(first, 2 * first + 1):
        begin, end = _range_of(leaf, n)
        diagonal = _box_of(points, begin, end, box)
        for ratio in (_FIRST_RADIUS, 1.0):
            if is_known[begin:end].all():
                break
            radius = ratio * diagonal
            found = _gather(points, axes, splits, box, radius, nodes, around)
            if found <= _CAPACITY:
                _fill_leaf(
                    points, begin, end, around[0][:found], around[1][:found], around[2][:found],
                    squares[:found], count, radius * radius, covariances, is_known,
                )  # fmt: skip
    return covariances, is_known
