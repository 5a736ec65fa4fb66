"""Which Gaussians can meet: pairs of means closer than the largest variances of either allow."""

import math

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector
from scanlock.kernels._compile import kernel, sum_kernel

_MOST_CELLS = 128
"""Cells along a side of the grid that the targets are sorted into."""

_GROUP = 16
"""Sources that share a look at the grid at most."""

_GROUP_SIDE = 3.0
"""They lie in a box of so many cells along x and y."""


@kernel
def centre_and_arms(means: Points) -> tuple[Vector, Vector]:
    """Return the mean (3,) [m] of some places, and the distance (m,) [m] of each from it."""
    centre = np.zeros(3, np.float64)
    for i in range(means.shape[0]):
        centre[0] += means[i, 0]
        centre[1] += means[i, 1]
        centre[2] += means[i, 2]
    centre /= max(1, means.shape[0])
    arms = np.empty(means.shape[0], np.float64)
    for i in range(means.shape[0]):
        x, y, z = means[i, 0] - centre[0], means[i, 1] - centre[1], means[i, 2] - centre[2]
        arms[i] = math.sqrt(x * x + y * y + z * z)
    return centre, arms


@kernel
def sorted_by_cell(
    means: Points, widths: Vector, least_side: float
) -> tuple[Labels, Labels, Matrix, Vector, float, int, int]:
    """Sort Gaussians into square cells of the xy plane.

    Parameters
    ----------
    means : (k, 3) [m]
        At least one.
    widths : (k,) [m^2]
    least_side : float [m]
        Of the cells, which are larger where there would be too many.

    Returns
    -------
    starts : (columns * rows + 1,)
        Where each cell begins in the order, row by row.
    order : (k,)
    sorted : (4, k)
        The coordinates of the means and the widths in that order.
    corner : (2,) [m]
        Of the first cell.
    side : float [m]
    columns, rows : int
    """
    k = means.shape[0]
    x0 = x1 = means[0, 0]
    y0 = y1 = means[0, 1]
    for j in range(k):
        x0, x1 = min(x0, means[j, 0]), max(x1, means[j, 0])
        y0, y1 = min(y0, means[j, 1]), max(y1, means[j, 1])
    side = max(least_side, (x1 - x0) / _MOST_CELLS, (y1 - y0) / _MOST_CELLS)
    columns, rows = int((x1 - x0) / side) + 1, int((y1 - y0) / side) + 1
    starts = np.zeros(columns * rows + 1, np.int64)
    cells = np.empty(k, np.int64)
    for j in range(k):
        column = min(columns - 1, int((means[j, 0] - x0) / side))
        row = min(rows - 1, int((means[j, 1] - y0) / side))
        cells[j] = row * columns + column
        starts[cells[j] + 1] += 1
    for cell in range(starts.shape[0] - 1):
        starts[cell + 1] += starts[cell]
    order = np.empty(k, np.int64)
    inside = np.empty((4, k), np.float64)
    cursor = starts[:-1].copy()
    for j in range(k):
        t = cursor[cells[j]]
        cursor[cells[j]] += 1
        order[t] = j
        inside[0, t], inside[1, t], inside[2, t] = means[j, 0], means[j, 1], means[j, 2]
        inside[3, t] = widths[j]
    return starts, order, inside, np.array([x0, y0]), side, columns, rows


@kernel
def _moved(means: Points, rotation: Matrix, translation: Vector) -> Matrix:
    """Return the coordinates (3, m) of places moved by a pose."""
    moved = np.empty((3, means.shape[0]), np.float64)
    for axis in range(3):
        a, b, c = rotation[axis, 0], rotation[axis, 1], rotation[axis, 2]
        for i in range(means.shape[0]):
            x, y, z = means[i, 0], means[i, 1], means[i, 2]
            moved[axis, i] = a * x + b * y + c * z + translation[axis]
    return moved


@kernel
def _group(places: Matrix, limits: Vector, first: int, side: float, box: Vector) -> int:
    """Find the sources from the first on that lie together; return which comes next.

    The box gets the least and the largest x, y and z, and the largest limit.
    """
    x0 = x1 = places[0, first]
    y0 = y1 = places[1, first]
    z0 = z1 = places[2, first]
    limit = limits[first]
    past = first + 1
    while past < min(first + _GROUP, places.shape[1]):
        x, y, z = places[0, past], places[1, past], places[2, past]
        if max(x1, x) - min(x0, x) > side or max(y1, y) - min(y0, y) > side:
            break
        x0, x1 = min(x0, x), max(x1, x)
        y0, y1 = min(y0, y), max(y1, y)
        z0, z1 = min(z0, z), max(z1, z)
        limit = max(limit, limits[past])
        past += 1
    box[0], box[1], box[2], box[3], box[4], box[5], box[6] = x0, x1, y0, y1, z0, z1, limit
    return past


@kernel
def _gather(
    starts: Labels, order: Labels, inside: Matrix, corner: Vector, side: float,
    columns: int, rows: int, widest: float, scale: float, box: Vector,
    near: Matrix, row_of: Labels,
) -> int:  # fmt: skip
    """Copy the targets in reach of a box, with scaled widths; return how many there are."""
    x0, x1, y0, y1, z0, z1, limit = box[0], box[1], box[2], box[3], box[4], box[5], box[6]
    radius = math.sqrt(scale * widest + limit)
    # Far places are cut to the grid while they are no whole numbers: those could overflow.
    left = int(min(max((x0 - radius - corner[0]) / side, 0.0), float(columns)))
    right = int(min(max((x1 + radius - corner[0]) / side + 1.0, 0.0), float(columns)))
    first = int(min(max((y0 - radius - corner[1]) / side, 0.0), float(rows)))
    last = int(min(max((y1 + radius - corner[1]) / side + 1.0, 0.0), float(rows)))
    count = np.uint64(0)
    for row in range(first, last):
        begin, end = starts[row * columns + left], starts[row * columns + right]
        for t in range(np.uint64(begin), np.uint64(end)):
            x, y, z, width = inside[0, t], inside[1, t], inside[2, t], scale * inside[3, t]
            dx, dy, dz = (
                max(x0 - x, x - x1, 0.0),
                max(y0 - y, y - y1, 0.0),
                max(z0 - z, z - z1, 0.0),
            )
            # Written every time and kept only when near: no branch to guess.
            near[0, count], near[1, count], near[2, count], near[3, count] = x, y, z, width
            row_of[count] = order[t]
            count += np.uint64(dx * dx + dy * dy + dz * dz < width + limit)
    return int(np.int64(count))


@sum_kernel
def targets_in_reach(
    starts: Labels, order: Labels, inside: Matrix, corner: Vector, side: float,
    columns: int, rows: int, widest: float,
    means: Points, widths: Vector, margins: Vector,
    rotation: Matrix, translation: Vector, scale: float,
) -> tuple[Labels, Labels]:  # fmt: skip
    """Return the targets within reach of each source at a pose, and none but these.

    A target is in reach when its squared distance is below ``scale (w_t + w_s) + margin``, with
    the widths w of both and the margin of the source. Source i has the
    ``members[ends[i] : ends[i + 1]]``. Sources that lie together, as neighbours in the order
    mostly do, share what lies around them.

    Parameters
    ----------
    starts, order, inside, corner, side, columns, rows
        The targets as `sorted_by_cell` returns them.
    widest : float [m^2]
        The largest width of the targets.
    means : (m, 3) [m]
        Of the sources, before they are moved.
    widths, margins : (m,) [m^2]
    rotation : (3, 3)
    translation : (3,) [m]
    scale : float
    """
    k, m = order.shape[0], means.shape[0]
    places = _moved(means, rotation, translation)
    limits = scale * widths + margins
    near, row_of, excess = np.empty((4, k), np.float64), np.empty(k, np.int64), np.empty(k)
    box = np.empty(7, np.float64)
    ends = np.zeros(m + 1, np.int64)
    members = np.empty(16 * m + k, np.int64)
    past = 0
    while past < m:
        first = past
        past = _group(places, limits, first, _GROUP_SIDE * side, box)
        count = _gather(
            starts, order, inside, corner, side, columns, rows, widest, scale, box, near, row_of
        )
        if members.shape[0] < ends[first] + _GROUP * count:
            more = members.shape[0] + _GROUP * count
            members = np.concatenate((members, np.empty(more, np.int64)))
        for i in range(first, past):
            x, y, z, limit = places[0, i], places[1, i], places[2, i], limits[i]
            for t in range(count):
                dx, dy, dz = near[0, t] - x, near[1, t] - y, near[2, t] - z
                excess[t] = dx * dx + dy * dy + dz * dz - near[3, t]
            filled = np.uint64(ends[i])
            for t in range(np.uint64(count)):
                members[filled] = row_of[t]
                filled += np.uint64(excess[t] < limit)
            ends[i + 1] = np.int64(filled)
    return ends, members[: ends[m]].copy()
