"""Points of hilly ground, and the low points of its cells."""

import numpy as np

from scanlock.arrays import read_only
from scanlock.clouds.polar_grid import PolarGrid
from scanlock.kernels.ground import point_passes

GRID = PolarGrid(sectors=24, max_range=30.0, first_width=1.0, growth=1.08)


def hills(seed, count=3000):
    """Points of hilly ground with boxes, reflections below it and points out of range."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(-25, 25, (count, 2))
    z = 0.8 * np.sin(xy[:, 0] / 6) + 0.05 * xy[:, 1] + rng.normal(0, 0.03, count)
    z += np.where((xy[:, 0] % 9 < 2) & (xy[:, 1] % 7 < 2), rng.uniform(0, 2, count), 0)
    z[rng.random(count) < 0.003] -= 2.0
    return read_only(np.column_stack([xy, z]))


def low_points(seed):
    """Coordinates and cells of the low points of the hills."""
    points = hills(seed)
    cells = GRID.cells(points)
    lowest = point_passes.lowest_points(points, cells, GRID.sectors * GRID.bins, 1)
    own = np.flatnonzero(lowest >= 0)
    low = points[lowest[own]]
    return [read_only(column) for column in low.T], read_only(own), low


def sector_starts(cells):
    """First row of each sector."""
    return read_only(np.searchsorted(cells, np.arange(GRID.sectors + 1) * GRID.bins))
