"""Range images from the definition, one point and one bin at a time."""

import itertools
import math

import numpy as np

_FACES = ((0, 1), (0, -1), (1, 1), (1, -1), (2, 1), (2, -1))


def bin_of(direction, side):
    """Face, row and column: the axis of the largest component, and where the ray leaves there."""
    axis = int(np.argmax(np.abs(direction)))
    face = _FACES.index((axis, 1 if direction[axis] > 0 else -1))
    leaves = np.delete(direction / abs(direction[axis]), axis)
    row, column = (min(side - 1, math.floor((one + 1.0) / 2.0 * side)) for one in leaves)
    return face, row, column


def nearest_ranges(points, side):
    """Least range of the points in each bin."""
    seen = {}
    for point in points:
        if point.any():
            seen.setdefault(bin_of(point, side), []).append(np.linalg.norm(point))
    ranges = np.full((6, side, side), math.inf)
    for place, found in seen.items():
        ranges[place] = min(found)
    return ranges


def nearest_around(ranges, reach):
    """Least range in the square of bins about each bin that has one, on its own face."""
    around = np.full(ranges.shape, math.inf)
    for face, i, j in zip(*np.nonzero(np.isfinite(ranges)), strict=True):
        rows, columns = (slice(max(0, one - reach), one + reach + 1) for one in (i, j))
        around[face, i, j] = ranges[face, rows, columns].min()
    return around


def free_space_violation(ranges, points, weights, pose, margin, share, hidden_margin, hidden_share):
    """Points that could be seen, their weight, and the weight of those nearer than allowed."""
    count, known, before = 0, 0.0, 0.0
    for point, weight in zip(points, weights, strict=True):
        moved = pose.rotation @ point + pose.translation
        seen = ranges[bin_of(moved, ranges.shape[1])] if moved.any() else math.inf
        distance = np.linalg.norm(moved)
        if math.isfinite(seen) and distance <= seen + hidden_margin + hidden_share * seen:
            count += 1
            known += weight
            before += weight * (distance < seen - margin - share * seen)
    return count, known, before


def every_bin(side):
    """The direction through the middle of every bin, row by row of every face."""
    middles = (np.arange(side) + 0.5) / side * 2.0 - 1.0
    return np.array(
        [
            np.insert([u, v], axis, sign)
            for (axis, sign), u, v in itertools.product(_FACES, middles, middles)
        ]
    )
