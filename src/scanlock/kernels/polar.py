"""Polar cells of points: sector by azimuth, bin by horizontal range."""

import math

import numpy as np

from scanlock.arrays import Labels, Points, Vector
from scanlock.kernels._compile import kernel


@kernel
def polar_cells(points: Points, sectors: int, edges: Vector) -> Labels:
    """Return the cell ``sector * bins + bin`` of each (n, 3) point, -1 from the last edge on.

    `edges` is ascending from 0; a range on an edge belongs to the bin outside it. A table over
    the innermost width finds the bin of a range in one look-up and a step or two.
    """
    bins = edges.shape[0] - 1
    table_width = edges[1] - edges[0]
    table_size = math.ceil(edges[bins] / table_width) + 1
    table = np.empty(table_size, np.int64)
    b = 0
    for k in range(table_size):
        while b + 1 < bins and edges[b + 1] <= k * table_width:
            b += 1
        table[k] = b

    n = points.shape[0]
    cells = np.empty(n, np.int64)
    sector_scale = sectors / (2.0 * math.pi)
    limit_squared = edges[bins] * edges[bins]
    for i in range(n):
        x = points[i, 0]
        y = points[i, 1]
        range_squared = x * x + y * y
        if not range_squared < limit_squared:
            cells[i] = -1
            continue
        azimuth = math.atan2(y, x)
        if azimuth < 0.0:
            azimuth += 2.0 * math.pi
        sector = int(azimuth * sector_scale)
        # An azimuth just short of a full turn may have been rounded up to it.
        if sector >= sectors:
            sector = sectors - 1
        distance = math.sqrt(range_squared)
        b = table[int(distance / table_width)]
        # The quotient may have been rounded up across an edge.
        if distance < edges[b]:
            b -= 1
        while b + 1 < bins and distance >= edges[b + 1]:
            b += 1
        cells[i] = sector * bins + b
    return cells
