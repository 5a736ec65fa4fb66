"""BEV grids from the definition, one point and one cell at a time."""

import math

import numpy as np


def height_bins(
    points,
    heights,
    is_obstacle,
    is_ground,
    level_from_scan,
    half_side,
    cell_size,
    bin_height,
    count,
):
    """Number of height bins of each cell with a point, and the mean level z of its ground."""
    side = 2 * half_side
    bins = [[set() for _ in range(side)] for _ in range(side)]
    ground = [[[] for _ in range(side)] for _ in range(side)]
    rows = zip(points, heights, is_obstacle, is_ground, strict=True)
    for point, height, point_is_obstacle, point_is_ground in rows:
        x, y, z = level_from_scan[:, :3] @ point + level_from_scan[:, 3]
        i, j = math.floor(x / cell_size) + half_side, math.floor(y / cell_size) + half_side
        if not (0 <= i < side and 0 <= j < side):
            continue
        if point_is_ground:
            ground[i][j].append(z)
        elif point_is_obstacle:
            h = z if math.isnan(height) else height
            bins[i][j].add(min(count - 1, max(0, math.floor(h / bin_height))))
    counts = np.array([[len(one) for one in row] for row in bins])
    means = np.array([[np.mean(one) if one else math.nan for one in row] for row in ground])
    return counts, means


def block_means(grid, size):
    """Mean of the numbers in each block."""
    blocks = [[grid[i : i + size, j : j + size] for j in range(0, grid.shape[1], size)]
              for i in range(0, grid.shape[0], size)]  # fmt: skip
    known = [[block[~np.isnan(block)] for block in row] for row in blocks]
    return np.array([[one.mean() if len(one) else math.nan for one in row] for row in known])


def occupied_and_free_cells(counts, ground, cell_size):
    """Centres of the occupied cells, their height bins, and centres of the free cells."""
    centres = (np.arange(len(counts)) + 0.5 - len(counts) / 2) * cell_size
    occupied = np.argwhere(counts > 0)
    free = np.argwhere((counts == 0) & ~np.isnan(ground))
    return centres[occupied], counts[occupied[:, 0], occupied[:, 1]], centres[free]


def rotated_grid(occupied_cells, occupancy, free_cells, free_cell_weight, heading, cell_size, side):
    """The correlation grid of a scan rotated to one heading."""
    rotation = np.array(
        [[math.cos(heading), -math.sin(heading)], [math.sin(heading), math.cos(heading)]]
    )
    grid = np.zeros((side, side), np.float32)
    free_values = np.full(len(free_cells), -free_cell_weight)
    for values, centres in ((free_values, free_cells), (occupancy, occupied_cells)):
        for value, centre in zip(values, centres, strict=True):
            i, j = (math.floor(c) + side // 2 for c in rotation @ centre / cell_size)
            if 0 <= i < side and 0 <= j < side:
                grid[i, j] = value if value < 0.0 else max(grid[i, j], value)
    return grid
