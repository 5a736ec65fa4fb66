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
    for k in range(max(own_bin - 2, 0), min(own_bin + 3, bins)):
        for across in range(sectors - 2, sectors + 3):
            j = point_of_cell[(own_sector + across) % sectors * bins + k]
            if j < 0 or j == i:
                continue
            dx = x[i] - x[j]
            dy = y[i] - y[j]
            if z[j] < z[i] + slack + slope * math.sqrt(dx * dx + dy * dy):
                found += 1
                if found == support:
                    return True
    return False


@kernel
def lower_envelope(
    x: Vector,
    y: Vector,
    z: Vector,
    cells: Labels,
    sectors: int,
    bins: int,
    steepest: float,
    slack: float,
    support: int,
) -> Vector:
    """Return at each low point the height of the lowest cone over the supported low points.

    A cone rises from each with the slope `steepest`; ground that is nowhere steeper lies on the
    envelope of the cones, and what stands on visible ground lies above it. The low points lie
    one to a polar cell; each passes the foot of its lowest cone on to the next occupied cell,
    outwards, inwards and around both ways, twice. Low points without `support`
    others around that are higher by `slack` and half of `steepest` at most have no cone.
    """
    n = x.shape[0]
    point_of_cell = np.full(sectors * bins, -1, np.int64)
    for i in range(n):
        point_of_cell[cells[i]] = i
    foot = np.full(n, -1, np.int64)
    envelope = np.full(n, math.inf, np.float64)
    for i in range(n):
        if is_supported(i, x, y, z, point_of_cell, cells[i], bins, 0.5 * steepest, slack, support):
            foot[i] = i
            envelope[i] = z[i]
    for sweep in range(8):
        along = sweep % 4 < 2
        lanes = sectors if along else bins
        # Around a ring one lap and a half, so that the seam is no border.
        steps = bins if along else sectors + sectors // 2
        for lane in range(lanes):
            f = -1
            for k in range(steps):
                step = k if sweep % 2 == 0 else steps - 1 - k
                if not along and step >= sectors:
                    step -= sectors
                cell = lane * bins + step if along else step * bins + lane
                i = point_of_cell[cell]
                if i < 0:
                    continue
                if f >= 0:
                    dx = x[i] - x[f]
                    dy = y[i] - y[f]
                    height = z[f] + steepest * math.sqrt(dx * dx + dy * dy)
                    if height < envelope[i]:
                        envelope[i] = height
                        foot[i] = f
                if foot[i] >= 0:
                    f = foot[i]
    return envelope
