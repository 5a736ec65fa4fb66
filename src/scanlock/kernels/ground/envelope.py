"""Which low points stand above others nearby: the lower envelope of cones."""

import math

import numpy as np

from scanlock.arrays import Labels, Vector
from scanlock.kernels._compile import kernel


@kernel
def is_supported(
    i: int,
    x: Vector,
    y: Vector,
    z: Vector,
    point_of_cell: Labels,
    cell: int,
    bins: int,
    slope: float,
    slack: float,
    support: int,
) -> bool:
    """Tell whether `support` low points around one could be ground together with it.

    Of the low points in the 5 x 5 polar cells around it, those support it that are higher by no
    more than `slack` and `slope` times their distance; nothing supports a stray reflection
    below ground.
    """
    sectors = point_of_cell.shape[0] // bins
    own_sector = cell // bins
    own_bin = cell % bins
    found = 0
    for across in range(own_sector - 2, own_sector + 3):
        # Sectors wrap; a division would take as long as all the rest.
        sector = across + sectors if across < 0 else across
        sector = sector - sectors if sector >= sectors else sector
        for k in range(max(own_bin - 2, 0), min(own_bin + 3, bins)):
            # No branches here: which cells are empty is hard to foretell.
            j = point_of_cell[sector * bins + k]
            other = np.uint64(max(j, 0))
            dx = x[i] - x[other]
            dy = y[i] - y[other]
            rise = z[other] - z[i] - slack
            is_near = rise < slope * math.sqrt(dx * dx + dy * dy)
            found += is_near & (j >= 0) & (j != i)
        if found >= support:
            return True
    return False


@kernel
def pass_feet_on(
    lane: Labels,
    x: Vector,
    y: Vector,
    z: Vector,
    steepest: float,
    backwards: bool,
    again: int,
    foot: Labels,
    envelope: Vector,
) -> None:
    """Pass the foot of its lowest cone on from each low point of a lane to the next.

    `lane` lists rows of low points; the first `again` of the walk are walked over twice. `foot`,
    -1 for none yet, and `envelope` are brought up to date.
    """
    n = lane.shape[0]
    f = np.int64(-1)
    for k in range(n + again):
        step = k if k < n else k - n
        i = np.uint64(lane[n - 1 - step] if backwards else lane[step])
        if f >= 0:
            dx = x[i] - x[np.uint64(f)]
            dy = y[i] - y[np.uint64(f)]
            rise = envelope[i] - z[np.uint64(f)]
            # The longer side spares most roots: hardly any cone is the lowest far from its foot.
            if rise > steepest * max(abs(dx), abs(dy)):
                height = z[np.uint64(f)] + steepest * math.sqrt(dx * dx + dy * dy)
                if height < envelope[i]:
                    envelope[i] = height
                    foot[i] = f
        if foot[i] >= 0:
            f = foot[i]


@kernel
def rows_of_rings(cells: Labels, bins: int) -> tuple[Labels, Labels]:
    """Return the rows of low points bin by bin, and where each of the bins starts."""
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
    steepest: float,
    slack: float,
    support: int,
) -> Vector:
    """Return at each low point the height of the lowest cone over the supported low points.

    A cone rises from each with the slope `steepest`; ground that is nowhere steeper lies on the
    envelope of the cones, and what stands on visible ground lies above it. The low points lie
    one to a polar cell, sector s owning the rows ``starts[s]:starts[s + 1]``; each passes the
    foot of its lowest cone on to the next, outwards, inwards and around both ways, twice. Low
    points without `support` others around that are higher by `slack` and half of `steepest` at
    most have no cone.
    """
    n = x.shape[0]
    sectors = starts.shape[0] - 1
    point_of_cell = np.full(sectors * bins, -1, np.int64)
    for i in range(n):
        point_of_cell[cells[i]] = i
    foot = np.full(n, -1, np.int64)
    envelope = np.full(n, math.inf, np.float64)
    for i in range(n):
        if is_supported(i, x, y, z, point_of_cell, cells[i], bins, 0.5 * steepest, slack, support):
            foot[i] = i
            envelope[i] = z[i]
    rows = np.arange(n)
    around, first = rows_of_rings(cells, bins)
    for sweep in range(8):
        backwards = sweep % 2 == 1
        if sweep % 4 < 2:
            for s in range(sectors):
                lane = rows[starts[s] : starts[s + 1]]
                pass_feet_on(lane, x, y, z, steepest, backwards, 0, foot, envelope)
        else:
            for k in range(bins):
                lane = around[first[k] : first[k + 1]]
                # One lap and a half, so that the seam is no border.
                again = lane.shape[0] // 2
                pass_feet_on(lane, x, y, z, steepest, backwards, again, foot, envelope)
    return envelope
