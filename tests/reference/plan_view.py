"""Plan views from the definition, one point and one column at a time."""

import math

import numpy as np


def column_slots(
    points, heights, is_standing, is_ground, level_from_scan, reach, width, slot, slots
):
    """Full slots of each column, and the mean level z of its ground."""
    side = 2 * reach
    filled = [[set() for _ in range(side)] for _ in range(side)]
    ground = [[[] for _ in range(side)] for _ in range(side)]
    for point, height, stands, lies in zip(points, heights, is_standing, is_ground, strict=True):
        x, y, z = level_from_scan[:, :3] @ point + level_from_scan[:, 3]
        i, j = math.floor(x / width) + reach, math.floor(y / width) + reach
        if not (0 <= i < side and 0 <= j < side):
            continue
        if lies:
            ground[i][j].append(z)
        elif stands:
            h = z if math.isnan(height) else height
            filled[i][j].add(min(slots - 1, max(0, math.floor(h / slot))))
    counts = np.array([[len(one) for one in row] for row in filled])
    means = np.array([[np.mean(one) if one else math.nan for one in row] for row in ground])
    return counts, means


def block_means(grid, size):
    """Mean of the numbers in each block."""
    blocks = [[grid[i : i + size, j : j + size] for j in range(0, grid.shape[1], size)]
              for i in range(0, grid.shape[0], size)]  # fmt: skip
    known = [[block[~np.isnan(block)] for block in row] for row in blocks]
    return np.array([[one.mean() if len(one) else math.nan for one in row] for row in known])


def full_and_open_columns(filled, ground, width):
    """Middles of the columns that are not empty, their slots, and those of ground alone."""
    middles = (np.arange(len(filled)) + 0.5 - len(filled) / 2) * width
    full, opened = np.argwhere(filled > 0), np.argwhere((filled == 0) & ~np.isnan(ground))
    return middles[full], filled[full[:, 0], full[:, 1]], middles[opened]


def turned_map(columns, fills, open_columns, openness, heading, cell, side):
    """The map of a scan turned by one heading."""
    turn = np.array(
        [[math.cos(heading), -math.sin(heading)], [math.sin(heading), math.cos(heading)]]
    )
    grid = np.zeros((side, side), np.float32)
    for values, places in ((np.full(len(open_columns), -openness), open_columns), (fills, columns)):
        for value, place in zip(values, places, strict=True):
            i, j = (math.floor(c) + side // 2 for c in turn @ place / cell)
            if 0 <= i < side and 0 <= j < side:
                grid[i, j] = value if value < 0.0 else max(grid[i, j], value)
    return grid
