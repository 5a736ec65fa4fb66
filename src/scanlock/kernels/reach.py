"""Which Gaussians can meet: pairs of means closer than the largest variances of either allow."""

import math

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector
from scanlock.kernels._compile import kernel, sum_kernel, sum_part


@kernel
def sorted_by_cell(
    means: Points, widths: Vector, corner: Vector, width: float, columns: int, rows: int
) -> tuple[Labels, Labels, Matrix]:
    """Sort Gaussians into square cells of the xy plane.

    Parameters
    ----------
    means : (k, 3) [m]
    widths : (k,) [m^2]
    corner : (2,) [m]
        Of the first cell; no mean lies beyond it.
    width : float [m]
        Side of a cell.
    columns, rows : int

    Returns
    -------
    starts : (columns * rows + 1,)
        Where each cell begins in the order, row by row.
    order : (k,)
    sorted : (4, k)
        The coordinates of the means and the widths in that order.
    """
    k = means.shape[0]
    starts = np.zeros(columns * rows + 1, np.int64)
    cells = np.empty(k, np.int64)
    for j in range(k):
        column = min(columns - 1, int((means[j, 0] - corner[0]) / width))
        row = min(rows - 1, int((means[j, 1] - corner[1]) / width))
        cells[j] = row * columns + column
        starts[cells[j] + 1] += 1
    for cell in range(columns * rows):
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


@sum_part
def _take_near(
    inside: Matrix, order: Labels, begin: int, end: int,
    x0: float, y0: float, z0: float, scale: float, limit: float,
    excess: Vector, members: Labels, filled: int,
) -> int:  # fmt: skip
    """Append the near ones of a run of targets; return how many members there are then."""
    for t in range(begin, end):
        dx, dy, dz = inside[0, t] - x0, inside[1, t] - y0, inside[2, t] - z0
        excess[t] = dx * dx + dy * dy + dz * dz - scale * inside[3, t]
    place = np.uint64(filled)
    for t in range(begin, end):
        # Written every time and kept only when near: no branch to guess.
        members[place] = order[t]
        place += np.uint64(excess[t] < limit)
    return int(place)


@sum_kernel
def targets_in_reach(
    starts: Labels,
    order: Labels,
    inside: Matrix,
    corner: Vector,
    width: float,
    columns: int,
    rows: int,
    widest: float,
    places: Points,
    source_widths: Vector,
    scale: float,
    margin: float,
) -> tuple[Labels, Labels]:
    """Return the targets within reach of each source, and none but these.

    A target is in reach when its squared distance is below ``scale (w_t + w_s) + margin``, with
    the widths w of both; `widest` is the largest of the targets. Source i has the
    ``members[ends[i] : ends[i + 1]]``. The targets come as `sorted_by_cell` leaves them.

    Parameters
    ----------
    places : (m, 3) [m]
        Means of the sources.
    source_widths : (m,) [m^2]
    scale : float
    margin : float [m^2]
    """
    k, m = order.shape[0], places.shape[0]
    ends = np.zeros(m + 1, np.int64)
    excess = np.empty(k, np.float64)
    members = np.empty(16 * m + k, np.int64)
    filled = 0
    for i in range(m):
        x0, y0, z0 = places[i, 0], places[i, 1], places[i, 2]
        limit = scale * source_widths[i] + margin
        radius = math.sqrt(scale * widest + limit)
        # Far places are cut to the grid while they are no whole numbers: those could overflow.
        first_column = int(min(max((x0 - radius - corner[0]) / width, 0.0), float(columns)))
        last_column = int(min(max((x0 + radius - corner[0]) / width + 1.0, 0.0), float(columns)))
        first_row = int(min(max((y0 - radius - corner[1]) / width, 0.0), float(rows)))
        last_row = int(min(max((y0 + radius - corner[1]) / width + 1.0, 0.0), float(rows)))
        if members.shape[0] < filled + k:
            members = np.concatenate((members, np.empty(members.shape[0] + k, np.int64)))
        if first_column < last_column:
            for row in range(first_row, last_row):
                begin = starts[row * columns + first_column]
                end = starts[row * columns + last_column]
                filled = _take_near(
                    inside, order, begin, end, x0, y0, z0, scale, limit,
                    excess, members, filled,
                )  # fmt: skip
        ends[i + 1] = filled
    return ends, members[:filled].copy()
