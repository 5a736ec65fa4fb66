"""Incremental sample consensus with a 1-D Gaussian process in every sector of a polar grid."""

import math

import numpy as np

from scanlock.arrays import Mask, Vector
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
    starts: Vector,
    ranges: Vector,
    heights: Vector,
    state: Vector,
    length: float,
    signal: float,
    noise: float,
    variance_limit: float,
    residual_limit: float,
) -> tuple[Mask, Vector, Vector]:
    """Grow the ground model of each sector from its seeds; return (accepted, mean, variance).

    Sector s owns the prototypes ``starts[s]:starts[s + 1]`` of `ranges` and `heights` (relative
    to the mean function). `state` is 1 for a seed and 0 for a candidate. A candidate joins when
    its variance is below `variance_limit` and its residual over the standard deviation of an
    observation there below `residual_limit`; mean and variance are brought up to date after
    each sweep over the candidates, until a sweep accepts none.
    """
    total = ranges.shape[0]
    accepted = np.zeros(total, np.bool_)
    mean = np.zeros(total, np.float64)
    variance = np.full(total, signal, np.float64)
    largest = 0
    for s in range(starts.shape[0] - 1):
        largest = max(largest, starts[s + 1] - starts[s])
    factor = np.empty(largest * largest, np.float64)
    joining = np.empty(largest, np.int64)
    for s in range(starts.shape[0] - 1):
        first = starts[s]
        n = starts[s + 1] - first
        r = ranges[first : first + n]
        m = mean[first : first + n]
        v = variance[first : first + n]
        used = 0
        count = 0
        for j in range(n):
            if state[first + j] == 1:
                joining[count] = j
                count += 1
        while count > 0:
            for c in range(count):
                j = joining[c]
                accepted[first + j] = True
                assimilate(r, j, heights[first + j], noise, length, signal, m, v, factor, used)
                used += 1
            count = 0
            for j in range(n):
                if accepted[first + j] or v[j] >= variance_limit:
                    continue
                if abs(heights[first + j] - m[j]) < residual_limit * math.sqrt(noise + v[j]):
                    joining[count] = j
                    count += 1
    return accepted, mean, variance
