"""Polar cells of points: sector by azimuth, bin by horizontal range.

No arc tangent is needed: azimuth is measured by `quarter_turns`, range in metres. Both are divided
into small steps with at most one border in each. Two tables hold the sector and the bin in which
each step begins, so one comparison finds the cell.
"""

import math

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Labels, Points, Vector
from scanlock.kernels._compile import helper, kernel

_BLOCK = 256
"""Points in a block, few enough for the block to stay in the cache."""

_Rows = NDArray[np.uint32]
"""Rows of tables. Unsigned, because Numba checks the sign of other indices."""


@kernel
def quarter_turns(x: float, y: float) -> float:
    """Return a monotonic measure of azimuth in [0, 4), an integer at each axis."""
    # The tiny number makes 0 / 0 a 0 and changes nothing else.
    fraction = y / (abs(x) + abs(y) + 1e-300)
    turns = fraction if x >= 0.0 else 2.0 - fraction
    return turns if turns >= 0.0 else turns + 4.0


@helper
def _sector_table(sectors: int) -> tuple[Vector, _Rows]:
    """Return the quarter turns at which sectors begin, and the sector in which each step begins.

    There are ``8 sectors`` steps; each sector has at least six.
    """
    # The last border is infinite: azimuths that round up to it stay in the last sector.
    borders = np.full(sectors + 1, math.inf, np.float64)
    for s in range(sectors):
        angle = s * 2.0 * math.pi / sectors
        borders[s] = quarter_turns(math.cos(angle), math.sin(angle))
    first = np.empty(8 * sectors + 1, np.uint32)
    s = 0
    for k in range(first.shape[0]):
        while borders[s + 1] <= k / (2.0 * sectors):
            s += 1
        first[k] = s
    return borders, first


@helper
def _bin_table(edges: Vector, step: float) -> tuple[Vector, _Rows]:
    """Return the ranges at which bins end, and the bin in which each step of the range begins."""
    bins = edges.shape[0] - 1
    ends = edges[1:].copy()
    ends[bins - 1] = math.inf
    first = np.empty(math.ceil(edges[bins] / step) + 2, np.uint32)
    b = 0
    for k in range(first.shape[0]):
        # A range may be rounded up across the start of its step.
        while b + 1 < bins and edges[b + 1] <= k * step * (1.0 - 1e-12):
            b += 1
        first[k] = b
    return ends, first


@helper
def _polar_coordinates(
    x: Vector,
    y: Vector,
    max_range: float,
    sector_steps: float,
    bin_steps: float,
    turns: Vector,
    ranges: Vector,
    sector_step: _Rows,
    bin_step: _Rows,
) -> None:
    """Write the azimuth and range of each point, and the steps of the tables they belong to."""
    for i in range(x.shape[0]):
        # As in `quarter_turns`, because a loop with a call in it does not use vector units.
        fraction = y[i] / (abs(x[i]) + abs(y[i]) + 1e-300)
        turn = fraction if x[i] >= 0.0 else 2.0 - fraction
        turn = turn if turn >= 0.0 else turn + 4.0
        distance = math.sqrt(x[i] * x[i] + y[i] * y[i])
        turns[i] = turn
        ranges[i] = distance
        sector_step[i] = np.uint32(turn * sector_steps)
        bin_step[i] = np.uint32(min(distance, max_range) * bin_steps)


@kernel
def polar_cells(points: Points, sectors: int, edges: Vector) -> Labels:
    """Return the cell ``sector * bins + bin`` of each (n, 3) point [m]; -1 from the last edge on.

    `edges` (bins + 1,) [m] ascend from 0, and no bin except the last is narrower than the first. A
    range on an edge belongs to the bin outside it.
    """
    n = points.shape[0]
    bins = edges.shape[0] - 1
    max_range = float(edges[bins])
    # Half the first bin, so that a step has at most one edge despite rounding.
    step = 0.5 * (edges[1] - edges[0])
    borders, first_sector = _sector_table(sectors)
    ends, first_bin = _bin_table(edges, step)
    cells = np.empty(n, np.int64)
    x = np.zeros(_BLOCK, np.float64)
    y = np.zeros(_BLOCK, np.float64)
    turns = np.empty(_BLOCK, np.float64)
    ranges = np.empty(_BLOCK, np.float64)
    sector_step = np.empty(_BLOCK, np.uint32)
    bin_step = np.empty(_BLOCK, np.uint32)
    one = np.uint32(1)
    for start in range(0, n, _BLOCK):
        count = min(_BLOCK, n - start)
        for i in range(count):
            x[i] = points[start + i, 0]
            y[i] = points[start + i, 1]
        _polar_coordinates(
            x, y, max_range, 2.0 * sectors, 1.0 / step, turns, ranges, sector_step, bin_step
        )
        own = cells[start : start + count]
        # Several short loops over a block in the cache are faster than a single one.
        for i in range(count):
            s = first_sector[sector_step[i]]
            s += np.uint32(turns[i] >= borders[s + one])
            own[i] = np.int64(s) * bins
        for i in range(count):
            b = first_bin[bin_step[i]]
            b += np.uint32(ranges[i] >= ends[b])
            own[i] += np.int64(b)
        for i in range(count):
            own[i] = own[i] if ranges[i] < max_range else -1
    return cells
