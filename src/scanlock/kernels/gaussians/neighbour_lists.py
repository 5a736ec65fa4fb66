"""Neighbour lists (Verlet): pairs of Gaussians close enough to score, by their largest variances.

The targets are sorted into the cells of a horizontal grid; groups of nearby sources search it
together.
"""

import math

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector
from scanlock.kernels._compile import helper, kernel, sum_kernel

_MAX_CELLS = 128
"""Largest number of cells along a side of the grid."""

_GROUP = 16
"""Largest number of sources in a group."""

_GROUP_SIDE = 3.0
"""Largest extent of a group along x and y, in cells."""


@kernel
def centroid_and_distances(means: Points) -> tuple[Vector, Vector]:
    """Return the centroid (3,) [m] of (m, 3) points, and the distance (m,) [m] of each from it."""
    centroid = np.zeros(3, np.float64)
    for i in range(means.shape[0]):
        centroid[0] += means[i, 0]
        centroid[1] += means[i, 1]
        centroid[2] += means[i, 2]
    centroid /= max(1, means.shape[0])
    distances = np.empty(means.shape[0], np.float64)
    for i in range(means.shape[0]):
        x, y, z = means[i, 0] - centroid[0], means[i, 1] - centroid[1], means[i, 2] - centroid[2]
        distances[i] = math.sqrt(x * x + y * y + z * z)
    return centroid, distances


@kernel
def sorted_by_cell(
    means: Points, variances: Vector, min_cell_size: float
) -> tuple[Labels, Labels, Matrix, Vector, float, int, int]:
    """Sort Gaussians into square cells of the xy plane.

    Parameters
    ----------
    means : (k, 3) [m]
        At least one.
    variances : (k,) [m^2]
        Largest principal variance of each.
    min_cell_size : float [m]
        Cells are larger where the grid would have more than 128 along a side.

    Returns
    -------
    starts : (columns * rows + 1,)
        First Gaussian of each cell in the order, row by row.
    order : (k,)
        Rows of `means`, sorted by cell.
    sorted : (4, k)
        Coordinates of the means and the variances in that order.
    corner : (2,) [m]
        Corner of the first cell.
    cell_size : float [m]
    columns, rows : int
    """
    k = means.shape[0]
    x0 = x1 = means[0, 0]
    y0 = y1 = means[0, 1]
    for j in range(k):
        x0, x1 = min(x0, means[j, 0]), max(x1, means[j, 0])
        y0, y1 = min(y0, means[j, 1]), max(y1, means[j, 1])
    cell_size = max(min_cell_size, (x1 - x0) / _MAX_CELLS, (y1 - y0) / _MAX_CELLS)
    columns, rows = int((x1 - x0) / cell_size) + 1, int((y1 - y0) / cell_size) + 1
    starts = np.zeros(columns * rows + 1, np.int64)
    cells = np.empty(k, np.int64)
    for j in range(k):
        column = min(columns - 1, int((means[j, 0] - x0) / cell_size))
        row = min(rows - 1, int((means[j, 1] - y0) / cell_size))
        cells[j] = row * columns + column
        starts[cells[j] + 1] += 1
    for cell in range(starts.shape[0] - 1):
        starts[cell + 1] += starts[cell]
    order = np.empty(k, np.int64)
    ordered = np.empty((4, k), np.float64)
    cursor = starts[:-1].copy()
    for j in range(k):
        t = cursor[cells[j]]
        cursor[cells[j]] += 1
        order[t] = j
        ordered[0, t], ordered[1, t], ordered[2, t] = means[j, 0], means[j, 1], means[j, 2]
        ordered[3, t] = variances[j]
    return starts, order, ordered, np.array([x0, y0]), cell_size, columns, rows


@helper
def _transformed(means: Points, rotation: Matrix, translation: Vector) -> Matrix:
    """Return the coordinates (3, m) [m] of points transformed by a pose."""
    positions = np.empty((3, means.shape[0]), np.float64)
    for axis in range(3):
        a, b, c = rotation[axis, 0], rotation[axis, 1], rotation[axis, 2]
        for i in range(means.shape[0]):
            x, y, z = means[i, 0], means[i, 1], means[i, 2]
            positions[axis, i] = a * x + b * y + c * z + translation[axis]
    return positions


@helper
def _end_of_group(
    positions: Matrix, limits: Vector, first: int, max_extent: float, box: Vector
) -> int:
    """Write the bounding box of the group of sources from the first on; return where it ends.

    `box` is the smallest and largest x, y and z, followed by the largest limit.
    """
    x0 = x1 = positions[0, first]
    y0 = y1 = positions[1, first]
    z0 = z1 = positions[2, first]
    limit = limits[first]
    end = first + 1
    while end < min(first + _GROUP, positions.shape[1]):
        x, y, z = positions[0, end], positions[1, end], positions[2, end]
        if max(x1, x) - min(x0, x) > max_extent or max(y1, y) - min(y0, y) > max_extent:
            break
        x0, x1 = min(x0, x), max(x1, x)
        y0, y1 = min(y0, y), max(y1, y)
        z0, z1 = min(z0, z), max(z1, z)
        limit = max(limit, limits[end])
        end += 1
    box[0], box[1], box[2], box[3], box[4], box[5], box[6] = x0, x1, y0, y1, z0, z1, limit
    return end


@helper
def _candidates(
    starts: Labels, order: Labels, sorted_targets: Matrix, corner: Vector, cell_size: float,
    columns: int, rows: int, max_variance: float, scale: float, box: Vector,
    near: Matrix, row_of: Labels,
) -> int:  # fmt: skip
    """Write the targets that may be neighbours of a group, with scaled variances; count them."""
    x0, x1, y0, y1, z0, z1, limit = box[0], box[1], box[2], box[3], box[4], box[5], box[6]
    radius = math.sqrt(scale * max_variance + limit)
    # Clamped to the grid before they become integers, which far positions could overflow.
    left = int(min(max((x0 - radius - corner[0]) / cell_size, 0.0), float(columns)))
    right = int(min(max((x1 + radius - corner[0]) / cell_size + 1.0, 0.0), float(columns)))
    first = int(min(max((y0 - radius - corner[1]) / cell_size, 0.0), float(rows)))
    last = int(min(max((y1 + radius - corner[1]) / cell_size + 1.0, 0.0), float(rows)))
    count = np.uint64(0)
    for row in range(first, last):
        begin, end = starts[row * columns + left], starts[row * columns + right]
        for t in range(np.uint64(begin), np.uint64(end)):
            x, y, z = sorted_targets[0, t], sorted_targets[1, t], sorted_targets[2, t]
            variance = scale * sorted_targets[3, t]
            dx, dy, dz = (
                max(x0 - x, x - x1, 0.0),
                max(y0 - y, y - y1, 0.0),
                max(z0 - z, z - z1, 0.0),
            )
            # Always written, kept only if near: no branch to predict.
            near[0, count], near[1, count], near[2, count], near[3, count] = x, y, z, variance
            row_of[count] = order[t]
            count += np.uint64(dx * dx + dy * dy + dz * dz < variance + limit)
    return int(np.int64(count))


@sum_kernel
def neighbour_lists(
    starts: Labels, order: Labels, sorted_targets: Matrix, corner: Vector, cell_size: float,
    columns: int, rows: int, max_variance: float,
    means: Points, variances: Vector, margins: Vector,
    rotation: Matrix, translation: Vector, scale: float,
) -> tuple[Labels, Labels]:  # fmt: skip
    """Return exactly the target Gaussians that are neighbours of each source Gaussian at a pose.

    A target is a neighbour if the squared distance of the means is below
    ``scale (v_t + v_s) + margin``, with the largest variance v of each and the margin of the
    source. Sources that are close together, as consecutive ones mostly are, share one search.

    Parameters
    ----------
    starts, order, sorted_targets, corner, cell_size, columns, rows
        The targets as `sorted_by_cell` returns them.
    max_variance : float [m^2]
        Largest variance of all targets.
    means : (m, 3) [m]
        Of the sources, in their own frame.
    variances, margins : (m,) [m^2]
    rotation, translation : (3, 3), (3,) [m]
        Pose of the source in the target's frame.
    scale : float

    Returns
    -------
    ends, members
        Source i has the targets ``members[ends[i] : ends[i + 1]]``.
    """
    k, m = order.shape[0], means.shape[0]
    positions = _transformed(means, rotation, translation)
    limits = scale * variances + margins
    near, row_of, excess = np.empty((4, k), np.float64), np.empty(k, np.int64), np.empty(k)
    box = np.empty(7, np.float64)
    ends = np.zeros(m + 1, np.int64)
    members = np.empty(16 * m + k, np.int64)
    end = 0
    while end < m:
        first = end
        end = _end_of_group(positions, limits, first, _GROUP_SIDE * cell_size, box)
        count = _candidates(
            starts, order, sorted_targets, corner, cell_size, columns, rows, max_variance, scale,
            box, near, row_of,
        )  # fmt: skip
        if members.shape[0] < ends[first] + _GROUP * count:
            more = members.shape[0] + _GROUP * count
            members = np.concatenate((members, np.empty(more, np.int64)))
        for i in range(first, end):
            x, y, z, limit = positions[0, i], positions[1, i], positions[2, i], limits[i]
            for t in range(count):
                dx, dy, dz = near[0, t] - x, near[1, t] - y, near[2, t] - z
                excess[t] = dx * dx + dy * dy + dz * dz - near[3, t]
            filled = np.uint64(ends[i])
            for t in range(np.uint64(count)):
                members[filled] = row_of[t]
                filled += np.uint64(excess[t] < limit)
            ends[i + 1] = np.int64(filled)
    return ends, members[: ends[m]].copy()
