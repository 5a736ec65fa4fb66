"""Which Gaussians of one scan lie within reach of each of the other."""

import math

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector
from scanlock.kernels._compile import kernel

_MOST_TILES_A_SIDE = 256
"""Wide maps get wider tiles instead of more memory."""


@kernel
def _tiled(
    target: Matrix, x: float, y: float, width: float, columns: int, rows: int
) -> tuple[Labels, Labels, Matrix]:
    """Return the rows of the targets tile by tile, where tiles start, and means with widths.

    Tile ``row * columns + column`` of the xy plane starts at ``(x, y) + width * (column, row)``.
    """
    count = target.shape[0]
    tiles = np.empty(count, np.int64)
    starts = np.zeros(columns * rows + 1, np.int64)
    for j in range(count):
        column = min(int((target[j, 0] - x) / width), columns - 1)
        row = min(int((target[j, 1] - y) / width), rows - 1)
        tiles[j] = row * columns + column
        starts[tiles[j] + 1] += 1
    for tile in range(columns * rows):
        starts[tile + 1] += starts[tile]
    cursor = starts.copy()
    order = np.empty(count, np.int64)
    places = np.empty((count, 4))
    for j in range(count):
        place = cursor[tiles[j]]
        cursor[tiles[j]] += 1
        order[place] = j
        places[place, 0], places[place, 1] = target[j, 0], target[j, 1]
        places[place, 2], places[place, 3] = target[j, 2], target[j, 9]
    return order, starts, places


@kernel
def targets_in_reach(
    target: Matrix, places: Points, widths: Vector, skins: Vector, window_end: float
) -> tuple[Labels, Labels]:
    """Return where the list of each source starts, (m + 1,), and the members of the lists.

    In reach are the targets whose mean is nearer than ``sqrt(window_end (sum of widths))`` and
    the skin of the source [m]; a few beyond may be listed. Rows of `target` (k, 11) hold mean,
    packed covariance, width and weight; `places` (m, 3) are the means of the sources in its frame.
    """
    count, sources = target.shape[0], places.shape[0]
    starts = np.zeros(sources + 1, np.int64)
    if count == 0 or sources == 0:
        return starts, np.empty(0, np.int64)
    low_x, low_y, high_x, high_y = math.inf, math.inf, -math.inf, -math.inf
    widest = 0.0
    for j in range(count):
        low_x, high_x = min(low_x, target[j, 0]), max(high_x, target[j, 0])
        low_y, high_y = min(low_y, target[j, 1]), max(high_y, target[j, 1])
        widest = max(widest, target[j, 9])
    reach = 0.0
    for i in range(sources):
        reach += math.sqrt(window_end * (widths[i] + widest)) + skins[i]
    span = max(high_x - low_x, high_y - low_y)
    # Half a reach: the tiles around a source then cover little more than what is in reach.
    tile = max(0.5 * reach / sources, span / _MOST_TILES_A_SIDE, 1e-9)
    columns, rows = int((high_x - low_x) / tile) + 1, int((high_y - low_y) / tile) + 1
    order, firsts, means = _tiled(target, low_x, low_y, tile, columns, rows)
    members = np.empty(8 * sources + count, np.int64)
    length = 0
    for i in range(sources):
        y0, y1, y2, skin = places[i, 0], places[i, 1], places[i, 2], skins[i]
        farthest = math.sqrt(window_end * (widths[i] + widest)) + skin
        # (r + skin)^2 <= (1 + e) r^2 + (1 + 1 / e) skin^2 for any e, so no pair needs a root.
        share = max(skin / max(farthest - skin, 1e-9), 1e-9)
        factor = (1.0 + share) * window_end
        rest = (1.0 + 1.0 / share) * skin * skin + factor * widths[i]
        left = math.floor(max((y0 - farthest - low_x) / tile, 0.0))
        right = math.floor(min((y0 + farthest - low_x) / tile, columns - 1.0))
        bottom = math.floor(max((y1 - farthest - low_y) / tile, 0.0))
        top = math.floor(min((y1 + farthest - low_y) / tile, rows - 1.0))
        if right >= left:
            for row in range(bottom, top + 1):
                first, last = firsts[row * columns + left], firsts[row * columns + right + 1]
                if length + last - first > members.shape[0]:
                    longer = np.empty(2 * members.shape[0] + last - first, np.int64)
                    longer[:length] = members[:length]
                    members = longer
                for m in range(first, last):
                    q0, q1, q2 = y0 - means[m, 0], y1 - means[m, 1], y2 - means[m, 2]
                    members[length] = order[m]
                    length += q0 * q0 + q1 * q1 + q2 * q2 < rest + factor * means[m, 3]
        starts[i + 1] = length
    return starts, members[:length]
