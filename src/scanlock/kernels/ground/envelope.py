"""Lower envelope of cones over low points, which shows the points that rise above the ground."""

import math

import numpy as np

from scanlock.arrays import Labels, Vector
from scanlock.kernels._compile import helper, kernel


@helper
def _is_supported(
    i: int,
    x: Vector,
    y: Vector,
    z: Vector,
    point_of_cell: Labels,
    cell: int,
    bins: int,
    slope: float,
    slack: float,
    min_support: int,
) -> bool:
    """Return whether enough low points nearby could be ground together with low point i.

    A low point in the 5 x 5 polar cells around it supports it unless it is higher by `slack` [m]
    plus `slope` times the distance, or more. This excludes false returns from below the ground.
    """
    sectors = point_of_cell.shape[0] // bins
    own_sector = cell // bins
    own_bin = cell % bins
    support = 0
    for across in range(own_sector - 2, own_sector + 3):
        # Sectors wrap around; a modulo would take as long as all the rest.
        sector = across + sectors if across < 0 else across
        sector = sector - sectors if sector >= sectors else sector
        for k in range(max(own_bin - 2, 0), min(own_bin + 3, bins)):
            # No branch here: which cells are empty is hard to predict.
            j = point_of_cell[sector * bins + k]
            other = np.uint64(max(j, 0))
            dx = x[i] - x[other]
            dy = y[i] - y[other]
            rise = z[other] - z[i] - slack
            is_near = rise < slope * math.sqrt(dx * dx + dy * dy)
            support += is_near & (j >= 0) & (j != i)
        if support >= min_support:
            return True
    return False


@helper
def _propagate_apexes(
    lane: Labels,
    x: Vector,
    y: Vector,
    z: Vector,
    max_slope: float,
    is_reversed: bool,
    extra: int,
    apex: Labels,
    envelope: Vector,
) -> None:
    """Offer each low point of a lane the lowest cone of the point before, in one pass.

    `lane` lists rows of low points; the pass goes on over its first `extra` points once more.
    `apex` (n,), the row of the lowest cone so far or -1, and `envelope` (n,) [m] are updated.
    """
    n = lane.shape[0]
    a = np.int64(-1)
    for k in range(n + extra):
        step = k if k < n else k - n
        i = np.uint64(lane[n - 1 - step] if is_reversed else lane[step])
        if a >= 0:
            dx = x[i] - x[np.uint64(a)]
            dy = y[i] - y[np.uint64(a)]
            rise = envelope[i] - z[np.uint64(a)]
            # The longer side bounds the distance and saves most square roots, because few cones
            # are the lowest far from their apex.
            if rise > max_slope * max(abs(dx), abs(dy)):
                height = z[np.uint64(a)] + max_slope * math.sqrt(dx * dx + dy * dy)
                if height < envelope[i]:
                    envelope[i] = height
                    apex[i] = a
        if apex[i] >= 0:
            a = apex[i]


@helper
def _sorted_by_bin(cells: Labels, bins: int) -> tuple[Labels, Labels]:
    """Return the rows of low points sorted by range bin, and the first row of each bin."""
    n = cells.shape[0]
    first = np.zeros(bins + 1, np.int64)
    for i in range(n):
        first[cells[i] % bins + 1] += 1
    for k in range(bins):
        first[k + 1] += first[k]
    end = first[:bins].copy()
    rows = np.empty(n, np.int64)
    for i in range(n):
        k = cells[i] % bins
        rows[end[k]] = i
        end[k] += 1
    return rows, first


@kernel
def lower_envelope(
    x: Vector,
    y: Vector,
    z: Vector,
    cells: Labels,
    starts: Labels,
    bins: int,
    max_slope: float,
    slack: float,
    min_support: int,
) -> Vector:
    """Return the height [m] of the lowest cone over each low point.

    A cone rises from each supported low point with the slope `max_slope`. Ground that is nowhere
    steeper lies on the envelope of the cones, and objects on visible ground lie above it. The
    envelope is found by passing the apex of the lowest cone from point to point: outwards,
    inwards and around in both directions, twice.

    Parameters
    ----------
    x, y, z : (n,) [m]
        Low points, at most one in a polar cell.
    cells : (n,)
        Polar cell ``sector * bins + bin`` of each.
    starts : (sectors + 1,)
        Sector s has the rows ``starts[s]:starts[s + 1]``.
    bins : int
    max_slope : float
    slack : float [m]
    min_support : int
        Low points with fewer supporting points nearby have no cone. Points that are higher by
        `slack` plus half of `max_slope` times the distance do not support.
    """
    n = x.shape[0]
    sectors = starts.shape[0] - 1
    point_of_cell = np.full(sectors * bins, -1, np.int64)
    for i in range(n):
        point_of_cell[cells[i]] = i
    apex = np.full(n, -1, np.int64)
    envelope = np.full(n, math.inf, np.float64)
    slope = 0.5 * max_slope
    for i in range(n):
        if _is_supported(i, x, y, z, point_of_cell, cells[i], bins, slope, slack, min_support):
            apex[i] = i
            envelope[i] = z[i]
    rows = np.arange(n)
    by_bin, first = _sorted_by_bin(cells, bins)
    for sweep in range(8):
        is_reversed = sweep % 2 == 1
        if sweep % 4 < 2:
            for s in range(sectors):
                lane = rows[starts[s] : starts[s + 1]]
                _propagate_apexes(lane, x, y, z, max_slope, is_reversed, 0, apex, envelope)
        else:
            for k in range(bins):
                lane = by_bin[first[k] : first[k + 1]]
                # One round and a half, because a ring is closed.
                extra = lane.shape[0] // 2
                _propagate_apexes(lane, x, y, z, max_slope, is_reversed, extra, apex, envelope)
    return envelope
