"""Polar cells of points: sector by azimuth, bin by horizontal range.

There is no arc tangent: azimuth is measured in `quarter_turns`, range in metres. Two tables tell
the sector and the bin in which each small step of them begins; no step has two borders in it, so
one comparison settles the rest.
"""

import math

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Labels, Points, Vector
from scanlock.kernels._compile import kernel

_BLOCK = 256
"""Points whose coordinates are taken apart at a time; what is known of them stays in the cache."""

_Rows = NDArray[np.uint32]
"""Rows of tables. Unsigned, as Numba looks at the sign of other indices before it uses them."""


@kernel
def quarter_turns(x: float, y: float) -> float:
    """Return a measure of azimuth in [0, 4): whole at the axes, growing in between."""
    # The smallest of numbers makes 0/0 a 0 and changes nothing else.
    share = y / (abs(x) + abs(y) + 1e-300)
    turns = share if x >= 0.0 else 2.0 - share
    return turns if turns >= 0.0 else turns + 4.0


@kernel
def _sector_table(sectors: int) -> tuple[Vector, _Rows]:
    """Return where sectors begin, in quarter turns, and the one in which each step begins.

    There are ``8 sectors`` steps; no sector measures less than six of them.
    """
    # The last border is out of reach: what rounds up to it stays in the last sector.
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


@kernel
def _bin_table(edges: Vector, step: float) -> tuple[Vector, _Rows]:
    """Return where bins end, and the one in which each step of the range begins."""
    bins = edges.shape[0] - 1
    ends = edges[1:].copy()
    ends[bins - 1] = math.inf
    first = np.empty(math.ceil(edges[bins] / step) + 2, np.uint32)
    b = 0
    for k in range(first.shape[0]):
        # A range may be rounded up across the beginning of its step.
        while b + 1 < bins and edges[b + 1] <= k * step * (1.0 - 1e-12):
            b += 1
        first[k] = b
    return ends, first


@kernel
def _measure(
    x: Vector,
    y: Vector,
    limit: float,
    sector_steps: float,
    bin_steps: float,
    turns: Vector,
    ranges: Vector,
    sector_step: _Rows,
    bin_step: _Rows,
) -> None:
    """Write the azimuth and range of each point, and the steps of the tables they fall into."""
    for i in range(x.shape[0]):
        # As in `quarter_turns`; a loop with a call in it does not use vector units.
        share = y[i] / (abs(x[i]) + abs(y[i]) + 1e-300)
        turn = share if x[i] >= 0.0 else 2.0 - share
        turn = turn if turn >= 0.0 else turn + 4.0
        distance = math.sqrt(x[i] * x[i] + y[i] * y[i])
        turns[i] = turn
        ranges[i] = distance
        sector_step[i] = np.uint32(turn * sector_steps)
        bin_step[i] = np.uint32(min(distance, limit) * bin_steps)


@kernel
def polar_cells(points: Points, sectors: int, edges: Vector) -> Labels:
    """Return the cell ``sector * bins + bin`` of each (n, 3) point, -1 from the last edge on.

    `edges` is ascending from 0, no bin narrower than the first but for the last; a range on an
    edge belongs to the bin outside it.
    """
    n = points.shape[0]
    bins = edges.shape[0] - 1
    limit = float(edges[bins])
    # Half the first bin, so that a step has one edge at most for all the rounding.
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
        _measure(x, y, limit, 2.0 * sectors, 1.0 / step, turns, ranges, sector_step, bin_step)
        own = cells[start : start + count]
        # Short loops over what the cache holds take less time than one that does it all.
        for i in range(count):
            s = first_sector[sector_step[i]]
            s += np.uint32(turns[i] >= borders[s + one])
            own[i] = np.int64(s) * bins
        for i in range(count):
            b = first_bin[bin_step[i]]
            b += np.uint32(ranges[i] >= ends[b])
            own[i] += np.int64(b)
        for i in range(count):
            own[i] = own[i] if ranges[i] < limit else -1
    return cells
