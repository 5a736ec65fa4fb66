"""Gaussian process regression and INSAC by their definitions, with full matrices."""

import numpy as np


def covariance(a, b, length, signal):
    """k(r, r') of all pairs of ranges; `signal` is a variance."""
    return signal * np.exp(-(np.subtract.outer(a, b) ** 2) / (2 * length**2))


def regression(r, z, noise, r_query, length, signal):
    """Posterior mean and variance at `r_query`; `noise` has one variance per observation."""
    if len(r) == 0:
        return np.zeros(len(r_query)), np.full(len(r_query), signal)
    gram = covariance(r, r, length, signal) + np.diag(noise)
    cross = covariance(r_query, r, length, signal)
    mean = cross @ np.linalg.solve(gram, z)
    return mean, signal - np.einsum("ij,ji->i", cross, np.linalg.solve(gram, cross.T))


def sector_consensus(r, z, seeds, max_residuals, borrowed, length, signal, noise, t_model, t_data):
    """INSAC of one sector; `borrowed` has (height, variance) or None for each prototype."""
    joined = list(np.flatnonzero(seeds))
    used = []

    def model():
        rows = joined + used
        heights = [z[j] for j in joined] + [borrowed[j][0] for j in used]
        noises = [noise] * len(joined) + [borrowed[j][1] for j in used]
        return regression(r[rows], np.array(heights), np.array(noises), r, length, signal)

    row = 0
    while True:
        mean, variance = model()
        fits = np.abs(z - mean) < np.minimum(t_data * np.sqrt(noise + variance), max_residuals)
        new = [j for j in np.flatnonzero(fits & (variance < t_model)) if j not in joined]
        if new and (joined or used):
            joined += new
            continue
        while row < len(r) and (variance[row] < t_model or borrowed[row] is None):
            row += 1
        if row == len(r):
            return np.isin(np.arange(len(r)), joined), mean, variance
        used.append(row)
        row += 1


def interpolated_heights(
    ranges, heights, means, variances, t_model, max_sectors, slope, max_difference
):
    """(height, variance) of each prototype from neighbouring sectors, or None."""
    sectors = len(ranges)
    result = [[None] * len(r) for r in ranges]
    for s in range(sectors):
        for i, r in enumerate(ranges[s]):
            if variances[s][i] < t_model or np.isnan(heights[s][i]):
                continue
            observations = []
            for side in (-1, 1):
                for step in range(1, max_sectors + 1):
                    t = (s + side * step) % sectors
                    near = np.abs(ranges[t] - r)
                    near[(variances[t] >= t_model) | (near >= max_difference)] = np.inf
                    if len(near) and np.isfinite(near.min()):
                        j = int(near.argmin())
                        across = (r * step * 2 * np.pi / sectors) ** 2 + near[j] ** 2
                        observations.append((means[t][j], variances[t][j] + slope**2 * across))
                        break
            if observations:
                weights = np.array([1 / variance for _, variance in observations])
                mean = np.array([height for height, _ in observations]) @ weights / weights.sum()
                result[s][i] = (mean, 1 / weights.sum())
    return result
