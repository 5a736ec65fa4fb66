"""Incremental sample consensus (INSAC) with a 1-D Gaussian process in each polar sector."""

import math

import numpy as np

from scanlock.arrays import Labels, Mask, Vector
from scanlock.kernels._compile import helper, kernel, sum_helper
from scanlock.kernels._inline import exp_negative, first_not_below

_Process = tuple[float, float, float, float, float]
"""Length scale [m], signal variance [m^2] and noise variance [m^2] of a process, and the limits
of variance [m^2] and of residual [deviations] below which an observation is accepted."""


@sum_helper
def _condition(
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
    """Condition the process at all ranges `r` [m] on one observation at range ``r[k]``.

    One step of a pivoted Cholesky factorisation: row `used` of the flattened `factor` becomes
    the posterior covariance of the observation with every range, over its standard deviation.
    `mean` [m] and `variance` [m^2] are updated in place; `signal` and `noise` are variances.
    """
    n = r.shape[0]
    deviation = math.sqrt(variance[k] + noise)
    innovation = (height - mean[k]) / deviation
    scale = 0.5 / (length * length)
    row = factor[used * n : (used + 1) * n]
    centre = r[k]
    for j in range(n):
        d = r[j] - centre
        row[j] = signal * exp_negative(scale * d * d)
    # Four at a time, so that the row is loaded and stored a fourth as often.
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


@helper
def _grow_sector(
    r: Vector,
    heights: Vector,
    seeds: Mask,
    max_residuals: Vector,
    shared_heights: Vector,
    shared_noise: Vector,
    process: _Process,
    accepted: Mask,
    mean: Vector,
    variance: Vector,
    factor: Vector,
    used: int,
    joining: Labels,
) -> int:
    """Grow the ground model of one sector, see `grow_sectors`; return the rows of its factor.

    It starts from `used` observations, whose rows are in `factor`, or from the seeds if there are
    none yet. `accepted`, `mean`, `variance` and `factor` are updated; `joining` is scratch.
    """
    length, signal, noise, variance_limit, residual_limit = process
    n = r.shape[0]
    candidate = 0
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
            height = float(heights[j])
            _condition(r, j, height, noise, length, signal, mean, variance, factor, used)
            used += 1
        count = 0
        if used > 0:
            for j in range(n):
                if accepted[j] or variance[j] >= variance_limit:
                    continue
                deviation = math.sqrt(noise + variance[j])
                threshold = min(residual_limit * deviation, max_residuals[j])
                if abs(heights[j] - mean[j]) < threshold:
                    joining[count] = j
                    count += 1
        if count > 0:
            continue
        while candidate < n and (
            variance[candidate] < variance_limit or not shared_noise[candidate] >= 0.0
        ):
            candidate += 1
        if candidate == n:
            return used
        height, own_noise = float(shared_heights[candidate]), float(shared_noise[candidate])
        _condition(r, candidate, height, own_noise, length, signal, mean, variance, factor, used)
        used += 1
        candidate += 1


@helper
def _share_heights(
    starts: Labels,
    ranges: Vector,
    heights: Vector,
    mean: Vector,
    variance: Vector,
    variance_limit: float,
    max_sectors: int,
    slope: float,
    max_gap: float,
    shared_heights: Vector,
    shared_noise: Vector,
    changed: Mask,
) -> None:
    """Write the heights that neighbouring sectors provide to uncertain prototypes.

    On either side, the nearest of `max_sectors` sectors with a certain model within `max_gap` [m]
    of the range provides its height. `slope` is the standard deviation of the ground's slope
    across sectors, so the variance of a height at the distance a grows by ``slope**2 a**2``. Two
    heights are averaged by their variances. Prototypes without a height of their own get none.
    `changed` marks the sectors that get any.
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
                for step in range(1, max_sectors + 1):
                    t = (s + side * step) % sectors
                    best = -1
                    nearest = max_gap
                    begin, end = int(starts[t]), int(starts[t + 1])
                    for j in range(first_not_below(ranges, begin, end, ranges[i] - max_gap), end):
                        outwards = ranges[j] - ranges[i]
                        if outwards >= max_gap:
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
                shared_heights[i] = weighted / weights
                shared_noise[i] = 1.0 / weights
                changed[s] = True


@kernel
def grow_sectors(
    starts: Labels,
    ranges: Vector,
    heights: Vector,
    seeds: Mask,
    max_residuals: Vector,
    length: float,
    signal: float,
    noise: float,
    variance_limit: float,
    residual_limit: float,
    exchanges: int,
    max_sectors: int,
    slope: float,
    max_gap: float,
) -> tuple[Mask, Vector, Vector]:
    """Grow the ground models of all sectors from their seeds.

    A candidate is accepted if its variance is below `variance_limit` and its residual is below
    both `residual_limit` standard deviations of an observation there and its own threshold. Mean
    and variance are updated after each pass over the candidates.

    When no more are accepted, uncertain prototypes take heights from neighbouring sectors (see
    `_share_heights`), from the inside out and only while they are uncertain, and growth continues.
    This is repeated for the sectors that get new heights.

    Parameters
    ----------
    starts : (sectors + 1,)
        Sector s has the prototypes ``starts[s]:starts[s + 1]``.
    ranges, heights : (n,) [m]
        Heights are relative to the mean function; NaN for none.
    seeds : (n,)
    max_residuals : (n,) [m]
    length : float [m]
        Length scale of the covariance function.
    signal, noise : float [m^2]
        Variances.
    variance_limit : float [m^2]
    residual_limit : float
    exchanges : int
        Number of exchanges between sectors.
    max_sectors : int
    slope : float
    max_gap : float [m]

    Returns
    -------
    accepted : (n,)
    mean, variance : (n,) [m], [m^2]
    """
    total = ranges.shape[0]
    sectors = starts.shape[0] - 1
    process = length, signal, noise, variance_limit, residual_limit
    accepted = np.zeros(total, np.bool_)
    mean = np.zeros(total, np.float64)
    variance = np.full(total, signal, np.float64)
    shared_heights = np.zeros(total, np.float64)
    shared_noise = np.full(total, math.nan, np.float64)
    changed = np.ones(sectors, np.bool_)
    max_size = 0
    for s in range(sectors):
        max_size = max(max_size, starts[s + 1] - starts[s])
    factor = np.empty(2 * max_size * max_size, np.float64)
    joining = np.empty(max_size, np.int64)
    # State of the sectors with uncertain prototypes after their own growth, from which each
    # exchange starts. The rows of their factors follow one another.
    rows = np.zeros(sectors, np.int64)
    begins = np.zeros(sectors, np.int64)
    factors = np.empty(64 * total + 1, np.float64)
    filled = 0
    own_accepted = accepted
    own_mean = mean
    own_variance = variance
    for exchange in range(exchanges + 1):
        if exchange == 1:
            own_accepted, own_mean, own_variance = accepted.copy(), mean.copy(), variance.copy()
        if exchange > 0:
            _share_heights(
                starts, ranges, heights, mean, variance, variance_limit, max_sectors, slope,
                max_gap, shared_heights, shared_noise, changed,
            )  # fmt: skip
        for s in range(sectors):
            if not changed[s]:
                continue
            own = slice(starts[s], starts[s + 1])
            size = rows[s] * (starts[s + 1] - starts[s])
            # Loops, because assigning slices to slices takes a second to compile.
            for k in range(size):
                factor[k] = factors[begins[s] + k]
            for j in range(starts[s], starts[s + 1]):
                accepted[j], mean[j], variance[j] = own_accepted[j], own_mean[j], own_variance[j]
            used = _grow_sector(
                ranges[own], heights[own], seeds[own], max_residuals[own],
                shared_heights[own], shared_noise[own], process,
                accepted[own], mean[own], variance[own], factor, rows[s], joining,
            )  # fmt: skip
            if exchange == 0 and exchanges > 0 and np.any(variance[own] >= variance_limit):
                rows[s] = used
                begins[s] = filled
                size = used * (starts[s + 1] - starts[s])
                while filled + size > factors.shape[0]:
                    factors = np.concatenate((factors, np.empty_like(factors)))
                for k in range(size):
                    factors[filled + k] = factor[k]
                filled += size
    return accepted, mean, variance
