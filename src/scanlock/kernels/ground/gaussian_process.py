"""Incremental sample consensus with a 1-D Gaussian process in every sector of a polar grid."""

import math

import numpy as np

from scanlock.arrays import Labels, Mask, Vector
from scanlock.kernels._compile import kernel, sum_kernel


@sum_kernel
def decay(x: float) -> float:
    """Return ``exp(-x)`` for x >= 0 to 1e-12, in arithmetic that loops can vectorise.

    The Taylor series of ``exp(-x / 1024)``, squared ten times; math.exp is a call.
    """
    y = min(x, 60.0) * -0.0009765625
    e = 1.0 + y * (1.0 + y * (0.5 + y * (1.0 / 6.0 + y * (1.0 / 24.0 + y * (1.0 / 120.0)))))
    e *= e
    e *= e
    e *= e
    e *= e
    e *= e
    e *= e
    e *= e
    e *= e
    e *= e
    return e * e


@sum_kernel
def assimilate(
    r: Vector,
    k: int,
    height: float,
    noise: float,
    length: float,
    signal: float,
    mean: Vector,
    variance: Vector,
    factor: Vector,
    used: int,
) -> None:
    """Condition the process at all ranges `r` on one observation at range ``r[k]``.

    One step of a pivoted Cholesky factorisation: row `used` of the flattened `factor` becomes
    the posterior covariance of the observation with every range, over its standard deviation.
    `mean` and `variance` are brought up to date in place; `signal` and `noise` are variances.
    """
    n = r.shape[0]
    deviation = math.sqrt(variance[k] + noise)
    innovation = (height - mean[k]) / deviation
    scale = 0.5 / (length * length)
    row = factor[used * n : (used + 1) * n]
    centre = r[k]
    for j in range(n):
        gap = r[j] - centre
        row[j] = signal * decay(scale * gap * gap)
    # Four at a time: the row is then loaded and stored a fourth as often.
    for m in range(0, used - 3, 4):
        a = factor[m * n : (m + 1) * n]
        b = factor[(m + 1) * n : (m + 2) * n]
        c = factor[(m + 2) * n : (m + 3) * n]
        d = factor[(m + 3) * n : (m + 4) * n]
        pa, pb, pc, pd = a[k], b[k], c[k], d[k]
        for j in range(n):
            row[j] -= pa * a[j] + pb * b[j] + pc * c[j] + pd * d[j]
    for m in range(used - used % 4, used):
        earlier = factor[m * n : (m + 1) * n]
        pivot = earlier[k]
        for j in range(n):
            row[j] -= pivot * earlier[j]
    for j in range(n):
        row[j] /= deviation
        mean[j] += innovation * row[j]
        variance[j] -= row[j] * row[j]


@kernel
def grow_sector(
    r: Vector,
    heights: Vector,
    seeds: Mask,
    caps: Vector,
    lent_heights: Vector,
    lent_noise: Vector,
    length: float,
    signal: float,
    noise: float,
    variance_limit: float,
    residual_limit: float,
    accepted: Mask,
    mean: Vector,
    variance: Vector,
    factor: Vector,
    used: int,
    joining: Labels,
) -> int:
    """Grow the ground model of one sector; see `grow_sectors`. Return the rows of its factor.

    It grows on from `used` observations, whose rows are in `factor`, or from its seeds if there
    are none yet. Brings `accepted`, `mean`, `variance` and `factor` up to date; `joining` is
    scratch.
    """
    n = r.shape[0]
    borrower = 0
    count = 0
    if used == 0:
        for j in range(n):
            if seeds[j]:
                joining[count] = j
                count += 1
    while True:
        for c in range(count):
            j = joining[c]
            accepted[j] = True
            seen = float(heights[j])
            assimilate(r, j, seen, noise, length, signal, mean, variance, factor, used)
            used += 1
        count = 0
        if used > 0:
            for j in range(n):
                if accepted[j] or variance[j] >= variance_limit:
                    continue
                gate = min(residual_limit * math.sqrt(noise + variance[j]), caps[j])
                if abs(heights[j] - mean[j]) < gate:
                    joining[count] = j
                    count += 1
        if count > 0:
            continue
        while borrower < n and (
            variance[borrower] < variance_limit or not lent_noise[borrower] >= 0.0
        ):
            borrower += 1
        if borrower == n:
            return used
        seen = float(lent_heights[borrower])
        doubt = float(lent_noise[borrower])
        assimilate(r, borrower, seen, doubt, length, signal, mean, variance, factor, used)
        used += 1
        borrower += 1


@kernel
def first_from(ascending: Vector, begin: int, end: int, value: float) -> int:
    """Return the first row from `begin` on whose number is no less than a value, or `end`."""
    while begin < end:
        middle = (begin + end) // 2
        if ascending[middle] < value:
            begin = middle + 1
        else:
            end = middle
    return begin


@kernel
def lend_heights(
    starts: Labels,
    ranges: Vector,
    heights: Vector,
    mean: Vector,
    variance: Vector,
    variance_limit: float,
    reach: int,
    slope: float,
    gap: float,
    lent_heights: Vector,
    lent_noise: Vector,
    changed: Mask,
) -> None:
    """Write what neighbouring sectors lend to uncertain prototypes, and who got something.

    On either side the nearest of `reach` sectors with a certain model within `gap` of the range
    lends; `slope` is the standard deviation of the ground's slope across sectors, so a height
    lent over the distance a is worth ``slope**2 a**2`` less. Two lenders are averaged by their
    variances. Prototypes without a height get nothing.
    """
    sectors = starts.shape[0] - 1
    for s in range(sectors):
        changed[s] = False
        for i in range(starts[s], starts[s + 1]):
            if variance[i] < variance_limit or math.isnan(heights[i]):
                continue
            weights = 0.0
            weighted = 0.0
            for side in (-1, 1):
                for step in range(1, reach + 1):
                    t = (s + side * step) % sectors
                    best = -1
                    nearest = gap
                    first = first_from(ranges, int(starts[t]), int(starts[t + 1]), ranges[i] - gap)
                    for j in range(first, starts[t + 1]):
                        outwards = ranges[j] - ranges[i]
                        if outwards >= gap:
                            break
                        if variance[j] < variance_limit and abs(outwards) < nearest:
                            best = j
                            nearest = abs(outwards)
                    if best >= 0:
                        arc = ranges[i] * step * 2.0 * math.pi / sectors
                        across = arc * arc + nearest * nearest
                        weight = 1.0 / (variance[best] + slope * slope * across)
                        weights += weight
                        weighted += weight * mean[best]
                        break
            if weights > 0.0:
                lent_heights[i] = weighted / weights
                lent_noise[i] = 1.0 / weights
                changed[s] = True


@kernel
def grow_sectors(
    starts: Labels,
    ranges: Vector,
    heights: Vector,
    seeds: Mask,
    caps: Vector,
    length: float,
    signal: float,
    noise: float,
    variance_limit: float,
    residual_limit: float,
    rounds: int,
    reach: int,
    slope: float,
    gap: float,
) -> tuple[Mask, Vector, Vector]:
    """Grow the ground models of all sectors from their seeds; return (accepted, mean, variance).

    Sector s owns the prototypes ``starts[s]:starts[s + 1]`` of `ranges` and `heights` (relative
    to the mean function). A candidate joins when its variance is below `variance_limit` and its
    residual below both `residual_limit` standard deviations of an observation there and its own
    cap; mean and variance are brought up to date after each sweep over the candidates.

    When no more join, uncertain prototypes take heights from neighbouring sectors
    (`lend_heights`), from the inside out and only as long as they stay uncertain, and growth
    goes on; this is repeated `rounds` times, for the sectors that were lent anything new.
    """
    total = ranges.shape[0]
    sectors = starts.shape[0] - 1
    accepted = np.zeros(total, np.bool_)
    mean = np.zeros(total, np.float64)
    variance = np.full(total, signal, np.float64)
    lent_heights = np.zeros(total, np.float64)
    lent_noise = np.full(total, math.nan, np.float64)
    changed = np.ones(sectors, np.bool_)
    largest = 0
    for s in range(sectors):
        largest = max(largest, starts[s + 1] - starts[s])
    factor = np.empty(2 * largest * largest, np.float64)
    joining = np.empty(largest, np.int64)
    # What sectors with something still uncertain ended with on their own: borrowing starts there,
    # each time anew. The rows of their factors lie one after the other.
    rows = np.zeros(sectors, np.int64)
    begins = np.zeros(sectors, np.int64)
    kept = np.empty(64 * total + 1, np.float64)
    filled = 0
    own_accepted = accepted
    own_mean = mean
    own_variance = variance
    for turn in range(rounds + 1):
        if turn == 1:
            own_accepted, own_mean, own_variance = accepted.copy(), mean.copy(), variance.copy()
        if turn > 0:
            lend_heights(
                starts, ranges, heights, mean, variance, variance_limit, reach, slope, gap,
                lent_heights, lent_noise, changed,
            )  # fmt: skip
        for s in range(sectors):
            if not changed[s]:
                continue
            own = slice(starts[s], starts[s + 1])
            size = rows[s] * (starts[s + 1] - starts[s])
            # Loops, as slices that are assigned to slices take a second to compile.
            for k in range(size):
                factor[k] = kept[begins[s] + k]
            for j in range(starts[s], starts[s + 1]):
                accepted[j], mean[j], variance[j] = own_accepted[j], own_mean[j], own_variance[j]
            used = grow_sector(
                ranges[own], heights[own], seeds[own], caps[own],
                lent_heights[own], lent_noise[own],
                length, signal, noise, variance_limit, residual_limit,
                accepted[own], mean[own], variance[own], factor, rows[s], joining,
            )  # fmt: skip
            if turn == 0 and rounds > 0 and np.any(variance[own] >= variance_limit):
                rows[s] = used
                begins[s] = filled
                size = used * (starts[s + 1] - starts[s])
                while filled + size > kept.shape[0]:
                    kept = np.concatenate((kept, np.empty_like(kept)))
                for k in range(size):
                    kept[filled + k] = factor[k]
                filled += size
    return accepted, mean, variance
