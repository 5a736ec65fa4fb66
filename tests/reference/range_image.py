"""Range images and free-space violations by definition, one point and one cell at a time."""

import itertools
import math

import numpy as np

_FACES = ((0, 1), (0, -1), (1, 1), (1, -1), (2, 1), (2, -1))


def cell_of(direction, side):
    """Face, row and column: the axis of the largest component, and where the ray meets the face."""
    axis = int(np.argmax(np.abs(direction)))
    face = _FACES.index((axis, 1 if direction[axis] > 0 else -1))
    on_face = np.delete(direction / abs(direction[axis]), axis)
    row, column = (min(side - 1, math.floor((one + 1.0) / 2.0 * side)) for one in on_face)
    return face, row, column


def build_range_image(points, side):
    """Range of the nearest point in each cell."""
    ranges_by_cell = {}
    for point in points:
        if point.any():
            ranges_by_cell.setdefault(cell_of(point, side), []).append(np.linalg.norm(point))
    ranges = np.full((6, side, side), math.inf)
    for cell, found in ranges_by_cell.items():
        ranges[cell] = min(found)
    return ranges


def minimum_filtered(ranges, neighbourhood):
    """Least range in the square of cells around each cell with a range, on its own face."""
    around = np.full(ranges.shape, math.inf)
    for face, i, j in zip(*np.nonzero(np.isfinite(ranges)), strict=True):
        rows, columns = (
            slice(max(0, one - neighbourhood), one + neighbourhood + 1) for one in (i, j)
        )
        around[face, i, j] = ranges[face, rows, columns].min()
    return around


def free_space_violation(ranges, points, weights, pose, margins, occlusion_margins):
    """Count and weight of the visible points, and the weight of those in free space.

    Margins are absolute and relative to the range.
    """
    count, visible, violating = 0, 0.0, 0.0
    for point, weight in zip(points, weights, strict=True):
        moved = pose.rotation @ point + pose.translation
        nearest = ranges[cell_of(moved, ranges.shape[1])] if moved.any() else math.inf
        distance = np.linalg.norm(moved)
        margin, occlusion_margin = (a + b * nearest for a, b in (margins, occlusion_margins))
        if math.isfinite(nearest) and distance <= nearest + occlusion_margin:
            count += 1
            visible += weight
            violating += weight * (distance < nearest - margin)
    return count, visible, violating


def every_cell(side):
    """Direction of the centre of every cell, row by row of every face."""
    middles = (np.arange(side) + 0.5) / side * 2.0 - 1.0
    return np.array(
        [
            np.insert([u, v], axis, sign)
            for (axis, sign), u, v in itertools.product(_FACES, middles, middles)
        ]
    )
