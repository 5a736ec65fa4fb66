"""Polar cells of points: sector by azimuth, bin by horizontal range."""

import math

import numpy as np

from scanlock.arrays import Labels, Points, Vector
from scanlock.kernels._compile import kernel


@kernel
def quarter_turns(x: float, y: float) -> float:
    """Return a measure of azimuth in [0, 4): whole at the axes, growing in between."""
    # The smallest of numbers makes 0/0 a 0 and changes nothing else.
    share = y / (abs(x) + abs(y) + 1e-300)
    turns = share if x >= 0.0 else 2.0 - share
    return turns if turns >= 0.0 else turns + 4.0


@kernel
def polar_cells(points: Points, sectors: int, edges: Vector) -> Labels:
    """Return the cell ``sector * bins + bin`` of each (n, 3) point, -1 from the last edge on.

    `edges` is ascending from 0; a range on an edge belongs to the bin outside it. There is no
    arc tangent: azimuth is measured in `quarter_turns`, range in metres; two tables tell the
    sector and the bin in which each small step of them begins, and a comparison or two settle
    the rest.
    """
    bins = edges.shape[0] - 1
    width = edges[1] - edges[0]
    first_bin = np.empty(math.ceil(edges[bins] / width) + 1, np.int64)
    b = 0
    for k in range(first_bin.shape[0]):
        while b + 1 < bins and edges[b + 1] <= k * width:
            b += 1
        first_bin[k] = b
    # The last borders are out of reach: what rounds up to them stays in the last bin or sector.
    ends = edges[1:].copy()
    ends[bins - 1] = math.inf
    borders = np.full(sectors + 1, math.inf, np.float64)
    for s in range(sectors):
        angle = s * 2.0 * math.pi / sectors
        borders[s] = quarter_turns(math.cos(angle), math.sin(angle))
    scale = 2.0 * sectors
    first_sector = np.empty(8 * sectors + 1, np.int64)
    s = 0
    for k in range(first_sector.shape[0]):
        while borders[s + 1] <= k / scale:
            s += 1
        first_sector[k] = s

    cells = np.empty(points.shape[0], np.int64)
    limit = edges[bins] * edges[bins]
    for i in range(points.shape[0]):
        x = points[i, 0]
        y = points[i, 1]
        squared = x * x + y * y
        if not squared < limit:
            cells[i] = -1
            continue
        turns = quarter_turns(x, y)
        s = first_sector[int(turns * scale)]
        while turns >= borders[s + 1]:
            s += 1
        distance = math.sqrt(squared)
        b = first_bin[int(distance / width)]
        # The quotient may have been rounded up across an edge.
        if distance < edges[b]:
            b -= 1
        while distance >= ends[b]:
            b += 1
        cells[i] = s * bins + b
    return cells
