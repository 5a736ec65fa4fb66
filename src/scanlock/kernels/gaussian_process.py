"""Incremental sample consensus with a 1-D Gaussian process in every sector of a polar grid."""

import math

import numpy as np

from scanlock.arrays import Labels, Mask, Vector
from scanlock.kernels._compile import kernel


@kernel
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
    scale = -0.5 / (length * length)
    row = factor[used * n : (used + 1) * n]
    for j in range(n):
        gap = r[j] - r[k]
        row[j] = signal * math.exp(scale * gap * gap)
    for m in range(used):
        earlier = factor[m * n : (m + 1) * n]
        pivot = earlier[k]
        for j in range(n):
            row[j] -= pivot * earlier[j]
    for j in range(n):
        row[j] /= deviation
        mean[j] += innovation * row[j]
        variance[j] -= row[j] * row[j]


@kernel
def insac_sectors(
    starts: Labels,
    ranges: Vector,
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
) -> tuple[Mask, Vector, Vector]:
    """Grow the ground model of each sector from its seeds; return (accepted, mean, variance).

    Sector s owns the prototypes ``starts[s]:starts[s + 1]`` of `ranges` and `heights` (relative
    to the mean function). A candidate joins when its variance is below `variance_limit` and its
    residual below both `residual_limit` standard deviations of an observation there and its own
    cap; mean and variance are brought up to date after each sweep. When a sweep accepts none,
    the innermost range that is still uncertain takes the height lent to it, if any
    (`lent_noise` is the variance of that height, NaN for none), and the sweeps go on.
    """
    total = ranges.shape[0]
    accepted = np.zeros(total, np.bool_)
    mean = np.zeros(total, np.float64)
    variance = np.full(total, signal, np.float64)
    largest = 0
    for s in range(starts.shape[0] - 1):
        largest = max(largest, starts[s + 1] - starts[s])
    factor = np.empty(2 * largest * largest, np.float64)
    joining = np.empty(largest, np.int64)
    for s in range(starts.shape[0] - 1):
        first = starts[s]
        n = starts[s + 1] - first
        r = ranges[first : first + n]
        m = mean[first : first + n]
        v = variance[first : first + n]
        used = 0
        count = 0
        borrower = 0
        for j in range(n):
            if seeds[first + j]:
                joining[count] = j
                count += 1
        while True:
            for c in range(count):
                j = joining[c]
                accepted[first + j] = True
                height = float(heights[first + j])
                assimilate(r, j, height, noise, length, signal, m, v, factor, used)
                used += 1
            count = 0
            if used > 0:
                for j in range(n):
                    if accepted[first + j] or v[j] >= variance_limit:
                        continue
                    gate = min(residual_limit * math.sqrt(noise + v[j]), caps[first + j])
                    if abs(heights[first + j] - m[j]) < gate:
                        joining[count] = j
                        count += 1
            if count > 0:
                continue
            while borrower < n and (
                v[borrower] < variance_limit or not lent_noise[first + borrower] >= 0.0
            ):
                borrower += 1
            if borrower == n:
                break
            j = borrower
            lent = float(lent_heights[first + j])
            doubt = float(lent_noise[first + j])
            assimilate(r, j, lent, doubt, length, signal, m, v, factor, used)
            used += 1
            borrower += 1
    return accepted, mean, variance


@kernel
def lend_heights(
    starts: Labels,
    ranges: Vector,
    mean: Vector,
    variance: Vector,
    variance_limit: float,
    reach: int,
    slope: float,
    gap: float,
) -> tuple[Vector, Vector]:
    """Return the (height, variance) that neighbouring sectors lend to uncertain prototypes.

    On either side the nearest of `reach` sectors with a certain model within `gap` of the range
    lends; `slope` is the standard deviation of the ground's slope across sectors, so a height
    lent over the arc a is worth ``slope**2 a**2`` less. Two lenders are averaged by their
    variances. NaN where nobody lends or nothing is needed.
    """
    total = ranges.shape[0]
    sectors = starts.shape[0] - 1
    height = np.full(total, math.nan, np.float64)
    noise = np.full(total, math.nan, np.float64)
    for s in range(sectors):
        for i in range(starts[s], starts[s + 1]):
            if variance[i] < variance_limit:
                continue
            weights = 0.0
            weighted = 0.0
            for side in (-1, 1):
                for step in range(1, reach + 1):
                    t = (s + side * step) % sectors
                    best = -1
                    nearest = gap
                    for j in range(starts[t], starts[t + 1]):
                        distance = abs(ranges[j] - ranges[i])
                        if variance[j] < variance_limit and distance < nearest:
                            best = j
                            nearest = distance
                    if best >= 0:
                        arc = ranges[i] * step * 2.0 * math.pi / sectors
                        across = arc * arc + nearest * nearest
                        weight = 1.0 / (variance[best] + slope * slope * across)
                        weights += weight
                        weighted += weight * mean[best]
                        break
            if weights > 0.0:
                height[i] = weighted / weights
                noise[i] = 1.0 / weights
    return height, noise
