"""Which Gaussians can meet: pairs of means closer than the largest variances of either allow."""

import math

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector
from scanlock.kernels._compile import kernel, sum_kernel


@kernel
def sorted_by_cell(
    means: Points,
    widths: Vector,
    widest: Vector,
    corner: Vector,
    width: float,
    columns: int,
    rows: int,
) -> tuple[Labels, Labels, Matrix]:
    """Sort Gaussians into square cells of the xy plane, those of each class on their own.

    Parameters
    ----------
    means : (k, 3) [m]
    widths : (k,) [m^2]
    widest : (c,) [m^2]
        The largest width of each class, ascending.
    corner : (2,) [m]
        Of the first cell; no mean lies beyond it.
    width : float [m]
        Side of a cell.
    columns, rows : int

    Returns
    -------
    starts : (c * columns * rows + 1,)
        Where each cell begins in the order, class by class and row by row.
    order : (k,)
    sorted : (4, k)
        The coordinates of the means and the widths in that order.
    """
    k = means.shape[0]
    starts = np.zeros(widest.shape[0] * columns * rows + 1, np.int64)
    cells = np.empty(k, np.int64)
    for j in range(k):
        column = min(columns - 1, int((means[j, 0] - corner[0]) / width))
        row = min(rows - 1, int((means[j, 1] - corner[1]) / width))
        kind = 0
        while widths[j] > widest[kind]:
            kind += 1
        cells[j] = (kind * rows + row) * columns + column
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
    return starts, order, inside


@sum_kernel
def targets_in_reach(
    starts: Labels,
    order: Labels,
    inside: Matrix,
    corner: Vector,
    width: float,
    columns: int,
    rows: int,
    widest: Vector,
    places: Points,
    source_widths: Vector,
    margins: Vector,
    scale: float,
) -> tuple[Labels, Labels]:
    """Return the targets within reach of each source, and none but these.

    A target is in reach when its squared distance is below ``scale (w_t + w_s) + margin``, with
    the widths w of both and the margin of the source. Source i has the
    ``members[ends[i] : ends[i + 1]]``. The targets come as `sorted_by_cell` leaves them: for the
    few wide ones one looks farther than for all others.

    Parameters
    ----------
    places : (m, 3) [m]
        Means of the sources.
    source_widths, margins : (m,) [m^2]
    scale : float
    """
    k, m = order.shape[0], places.shape[0]
    ends = np.zeros(m + 1, np.int64)
    excess = np.empty(k, np.float64)
    members = np.empty(16 * m + k, np.int64)
    filled = 0
    for i in range(m):
        x0, y0, z0 = places[i, 0], places[i, 1], places[i, 2]
        limit = scale * source_widths[i] + margins[i]
        if members.shape[0] < filled + k:
            members = np.concatenate((members, np.empty(members.shape[0] + k, np.int64)))
        for kind in range(widest.shape[0]):
            radius = math.sqrt(scale * widest[kind] + limit)
            # Far places are cut to the grid while they are no whole numbers: those could overflow.
            left = min(max((x0 - radius - corner[0]) / width, 0.0), float(columns))
            right = min(max((x0 + radius - corner[0]) / width + 1.0, 0.0), float(columns))
            first = min(max((y0 - radius - corner[1]) / width, 0.0), float(rows))
            last = min(max((y0 + radius - corner[1]) / width + 1.0, 0.0), float(rows))
            if int(left) == int(right):
                continue
            for row in range(int(first), int(last)):
                begin = starts[(kind * rows + row) * columns + int(left)]
                end = starts[(kind * rows + row) * columns + int(right)]
                for t in range(begin, end):
                    dx, dy, dz = inside[0, t] - x0, inside[1, t] - y0, inside[2, t] - z0
                    excess[t] = dx * dx + dy * dy + dz * dz - scale * inside[3, t]
                place = np.uint64(filled)
                for t in range(begin, end):
                    # Written every time and kept only when near: no branch to guess.
                    members[place] = order[t]
                    place += np.uint64(excess[t] < limit)
                filled = np.int64(place)
        ends[i + 1] = filled
    return ends, members[:filled].copy()
