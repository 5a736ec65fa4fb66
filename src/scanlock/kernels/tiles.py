"""Which Gaussians reach which tile of the plane, so that a point looks at a few only."""

import math

import numpy as np

from scanlock.arrays import Labels, Points, Vector
from scanlock.kernels._compile import kernel


@kernel
def tile_lists(
    means: Points, radii: Vector, corner: Vector, width: float, columns: int, rows: int
) -> tuple[Labels, Labels]:
    """Return which Gaussians reach into each square tile of the xy plane.

    Tile ``row * columns + column`` starts at ``corner + width * (column, row)``; its Gaussians
    are ``members[starts[tile] : starts[tile + 1]]``, ascending. A Gaussian reaches a tile when
    the disc of its radius does.
    """
    tiles = columns * rows
    starts = np.zeros(tiles + 1, np.int64)
    members = np.empty(0, np.int64)
    cursor = np.empty(0, np.int64)
    for fill in range(2):
        if fill == 1:
            for tile in range(tiles):
                starts[tile + 1] += starts[tile]
            members = np.empty(starts[tiles], np.int64)
            cursor = starts[:-1].copy()
        for j in range(means.shape[0]):
            x = means[j, 0] - corner[0]
            y = means[j, 1] - corner[1]
            first_column = max(0, math.floor((x - radii[j]) / width))
            last_column = min(columns - 1, math.floor((x + radii[j]) / width))
            first_row = max(0, math.floor((y - radii[j]) / width))
            last_row = min(rows - 1, math.floor((y + radii[j]) / width))
            for row in range(first_row, last_row + 1):
                gap_y = max(row * width - y, y - (row + 1) * width, 0.0)
                for column in range(first_column, last_column + 1):
                    gap_x = max(column * width - x, x - (column + 1) * width, 0.0)
                    if gap_x * gap_x + gap_y * gap_y > radii[j] * radii[j]:
                        continue
                    tile = row * columns + column
                    if fill == 0:
                        starts[tile + 1] += 1
                    else:
                        members[cursor[tile]] = j
                        cursor[tile] += 1
    return starts, members
