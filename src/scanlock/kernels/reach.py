"""Which Gaussians can meet: pairs of means closer than the largest variances of either allow."""

import math

import numpy as np

from scanlock.arrays import Labels, Points, Vector
from scanlock.kernels._compile import kernel, sum_kernel, sum_part

_MOST_CELLS = 128
"""Cells along a side of the grid that targets are sorted into."""


@kernel
def _sorted_by_cell(
    means: Points, corner: Vector, width: float, columns: int, rows: int
) -> tuple[Labels, Labels]:
    """Return where each square cell of the xy plane begins in an order of the means, and that."""
    starts = np.zeros(columns * rows + 1, np.int64)
    cells = np.empty(means.shape[0], np.int64)
    for j in range(means.shape[0]):
        column = min(columns - 1, int((means[j, 0] - corner[0]) / width))
        row = min(rows - 1, int((means[j, 1] - corner[1]) / width))
        cells[j] = row * columns + column
        starts[cells[j] + 1] += 1
    for cell in range(columns * rows):
        starts[cell + 1] += starts[cell]
    order = np.empty(means.shape[0], np.int64)
    cursor = starts[:-1].copy()
    for j in range(means.shape[0]):
        order[cursor[cells[j]]] = j
        cursor[cells[j]] += 1
    return starts, order


@sum_part
def _take_near(
    x: Vector, y: Vector, z: Vector, widths: Vector, rows: Labels, begin: int, end: int,
    x0: float, y0: float, z0: float, scale: float, limit: float,
    excess: Vector, members: Labels, filled: int,
) -> int:  # fmt: skip
    """Append the rows of the near ones of a run of targets; return how many there are then."""
    for t in range(begin, end):
        dx, dy, dz = x[t] - x0, y[t] - y0, z[t] - z0
        excess[t] = dx * dx + dy * dy + dz * dz - scale * widths[t]
    place = np.uint64(filled)
    for t in range(begin, end):
        # Written every time and kept only when near: no branch to guess.
        members[place] = rows[t]
        place += np.uint64(excess[t] < limit)
    return int(place)


@sum_kernel
def targets_in_reach(
    target_means: Points,
    target_widths: Vector,
    places: Points,
    source_widths: Vector,
    scale: float,
    margin: float,
    first: int,
    enough: int,
) -> tuple[Labels, Labels]:
    """Return the targets within reach of each source from row `first` on, and none but these.

    A target is in reach when its squared distance is below ``scale (w_t + w_s) + margin``, with
    the widths w of both. Source ``first + i`` has the ``members[starts[i] : starts[i + 1]]``. It
    ends after the source that brings the number of members to `enough`.

    Parameters
    ----------
    target_means, places : (k, 3), (m, 3) [m]
    target_widths, source_widths : (k,), (m,) [m^2]
    scale : float
    margin : float [m^2]
    first, enough : int
    """
    k, m = target_means.shape[0], places.shape[0]
    starts = np.zeros(m - first + 1, np.int64)
    if k == 0 or m == 0:
        return starts, np.empty(0, np.int64)
    widest = target_widths.max()
    corner = np.array([target_means[:, 0].min(), target_means[:, 1].min()])
    sides = max(target_means[:, 0].max() - corner[0], target_means[:, 1].max() - corner[1])
    reach = math.sqrt(scale * (widest + source_widths.max()) + margin)
    # Half the reach: of what is looked at, half is in reach.
    width = max(0.5 * reach, sides / _MOST_CELLS, 1e-9)
    columns = int((target_means[:, 0].max() - corner[0]) / width) + 1
    rows = int((target_means[:, 1].max() - corner[1]) / width) + 1
    begins, order = _sorted_by_cell(target_means, corner, width, columns, rows)
    x, y, z, widths = np.empty(k), np.empty(k), np.empty(k), np.empty(k)
    for t in range(k):
        j = order[t]
        x[t], y[t], z[t] = target_means[j, 0], target_means[j, 1], target_means[j, 2]
        widths[t] = target_widths[j]

    excess = np.empty(k, np.float64)
    members = np.empty(16 * m + k, np.int64)
    filled = 0
    for i in range(first, m):
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
                begin = begins[row * columns + first_column]
                end = begins[row * columns + last_column]
                filled = _take_near(
                    x, y, z, widths, order, begin, end, x0, y0, z0, scale, limit,
                    excess, members, filled,
                )  # fmt: skip
        starts[i - first + 1] = filled
        if filled >= enough:
            return starts[: i - first + 2].copy(), members[:filled].copy()
    return starts, members[:filled].copy()
