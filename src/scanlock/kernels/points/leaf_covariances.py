"""Covariances of the points nearest to each point of a k-d tree, for a whole leaf at a time.

Points of a leaf lie close together and have most neighbours in common. All points around the leaf
are gathered once, and which of them are the nearest of a point is told by a distance that just as
many lie within: no list is sorted, and every loop goes through vector units. The layout of the
tree is told in `kernels/points/point_tree.py`.
"""

import math

import numpy as np

from scanlock.arrays import Labels, Mask, Matrix, Points, Vector
from scanlock.kernels._compile import kernel, sum_kernel

_MOST_LEVELS = 64
"""Cuts on the way to a leaf, and so the most sides on the stack; 2^64 points have more."""

_ROOM = 1024
"""Points that may be gathered around a leaf; where there are more it is left out."""

_NEAR = 0.5
"""Neighbours are looked for within this share of the diagonal of a leaf, then within all of it."""

_MOST_TRIALS = 24
"""Distances that are tried; more are wanted only where neighbours are equally far."""


@kernel
def _range_of(node: int, count: int) -> tuple[int, int]:
    """Return the rows from low to high that a node of a tree of `count` points holds."""
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


@kernel
def _box_of(points: Points, low: int, high: int, box: Matrix) -> float:
    """Write the least and largest coordinates (2, 3) of some rows; return the diagonal."""
    box[0], box[1] = np.inf, -np.inf
    for p in range(low, high):
        for axis in range(3):
            box[0, axis] = min(box[0, axis], points[p, axis])
            box[1, axis] = max(box[1, axis], points[p, axis])
    d0, d1, d2 = box[1, 0] - box[0, 0], box[1, 1] - box[0, 1], box[1, 2] - box[0, 2]
    return math.sqrt(d0 * d0 + d1 * d1 + d2 * d2)


@kernel
def _gather(
    points: Points, axes: Labels, cuts: Vector, box: Matrix, reach: float, nodes: Labels,
    around: Matrix,
) -> int:  # fmt: skip
    """Copy the points at most `reach` from a box, axis by axis; return how many there are.

    More than there is room for where some were left out.
    """
    least0, least1, least2 = box[0, 0] - reach, box[0, 1] - reach, box[0, 2] - reach
    most0, most1, most2 = box[1, 0] + reach, box[1, 1] + reach, box[1, 2] + reach
    nodes[0, 0], nodes[0, 1], nodes[0, 2] = 0, 0, points.shape[0]
    top, found = 1, 0
    while top > 0:
        top -= 1
        node, low, high = nodes[top, 0], nodes[top, 1], nodes[top, 2]
        if node < axes.shape[0]:
            axis, middle = axes[node], (low + high) // 2
            if box[1, axis] + reach >= cuts[node]:
                nodes[top, 0], nodes[top, 1], nodes[top, 2] = 2 * node + 2, middle, high
                top += 1
            if box[0, axis] - reach <= cuts[node]:
                nodes[top, 0], nodes[top, 1], nodes[top, 2] = 2 * node + 1, low, middle
                top += 1
            continue
        if found + high - low > _ROOM:
            return _ROOM + 1
        for p in range(low, high):
            x, y, z = points[p, 0], points[p, 1], points[p, 2]
            around[0, found], around[1, found], around[2, found] = x, y, z
            found += (
                (x >= least0) & (x <= most0) & (y >= least1) & (y <= most1)
                & (z >= least2) & (z <= most2)
            )  # fmt: skip
    return found


@sum_kernel
def _count_within(squares: Vector, limit: float) -> float:
    """Return how many squared distances are no more than a limit."""
    found = 0.0
    for p in range(squares.shape[0]):
        found += 1.0 if squares[p] <= limit else 0.0
    return found


@kernel
def _limit_of(squares: Vector, count: int, most: float, guess: float) -> float:
    """Return a limit that just `count` squared distances lie within, or -1 if none is found.

    At most `most`. On a surface the number within is in proportion to the squared distance.
    """
    low, of_low, high, of_high = 0.0, 0.0, most, -1.0
    limit = min(guess, most)
    for trial in range(_MOST_TRIALS):
        found = _count_within(squares, limit)
        if found == count:
            return limit
        if found > count:
            high, of_high = limit, found
        else:
            low, of_low = limit, found
            if of_high < 0.0:
                of_high = _count_within(squares, most)
                if of_high <= count:
                    return most if of_high == count else -1.0
        share = (count + 0.5 - of_low) / (of_high - of_low) if trial % 4 < 3 else 0.5
        limit = low + share * (high - low)
    return -1.0


@sum_kernel
def _add_within(
    x: Vector, y: Vector, z: Vector, squares: Vector, limit: float,
    x0: float, x1: float, x2: float, count: int, covariance: Vector,
) -> None:  # fmt: skip
    """Write the packed covariance of the points within a limit of a place."""
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
    share = 1.0 / count
    sx, sy, sz = share * sx, share * sy, share * sz
    covariance[0], covariance[1] = share * xx - sx * sx, share * xy - sx * sy
    covariance[2], covariance[3] = share * xz - sx * sz, share * yy - sy * sy
    covariance[4], covariance[5] = share * yz - sy * sz, share * zz - sz * sz


@kernel
def _cover_leaf(
    points: Points, begin: int, end: int, x: Vector, y: Vector, z: Vector, squares: Vector,
    count: int, most: float, covariances: Matrix, is_known: Mask,
) -> None:  # fmt: skip
    """Write the covariances of the points of a leaf whose neighbours are among those around."""
    limit = 0.5 * most
    for q in range(begin, end):
        if is_known[q]:
            continue
        x0, x1, x2 = points[q, 0], points[q, 1], points[q, 2]
        for p in range(x.shape[0]):
            d0, d1, d2 = x[p] - x0, y[p] - x1, z[p] - x2
            squares[p] = d0 * d0 + d1 * d1 + d2 * d2
        found = _limit_of(squares, count, most, limit)
        if found >= 0.0:
            limit = found
            _add_within(x, y, z, squares, limit, x0, x1, x2, count, covariances[q])
            is_known[q] = True


@kernel
def leaf_covariances(points: Points, axes: Labels, cuts: Vector, count: int) -> tuple[Matrix, Mask]:
    """Return the covariances of the nearest points of each point, and which of them are known.

    Unknown are those of points with neighbours far beyond their leaf, or with several equally far
    of which some are too many.

    Parameters
    ----------
    points, axes, cuts
        The tree.
    count : int
        Neighbours of a point, itself included.

    Returns
    -------
    covariances : (n, 6) [m^2]
        Packed as xx, xy, xz, yy, yz, zz and divided by `count`.
    is_known : (n,)
    """
    n, first = points.shape[0], axes.shape[0]
    covariances, is_known = np.zeros((n, 6)), np.zeros(n, np.bool_)
    nodes, box = np.empty((_MOST_LEVELS, 3), np.int64), np.empty((2, 3))
    around, squares = np.empty((3, _ROOM + 1)), np.empty(_ROOM)
    for leaf in range(first, 2 * first + 1):
        begin, end = _range_of(leaf, n)
        diagonal = _box_of(points, begin, end, box)
        for share in (_NEAR, 1.0):
            if is_known[begin:end].all():
                break
            reach = share * diagonal
            found = _gather(points, axes, cuts, box, reach, nodes, around)
            if found <= _ROOM:
                _cover_leaf(
                    points, begin, end, around[0][:found], around[1][:found], around[2][:found],
                    squares[:found], count, reach * reach, covariances, is_known,
                )  # fmt: skip
    return covariances, is_known
