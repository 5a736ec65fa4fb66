"""Gaussian process regression and INSAC as their definitions read, with whole matrices."""

import numpy as np


def covariance(a, b, length, signal):
    """k(r, r') of all pairs; `signal` is a variance."""
    return signal * np.exp(-(np.subtract.outer(a, b) ** 2) / (2 * length**2))


def regression(r_seen, z_seen, noise, r_asked, length, signal):
    """Posterior mean and variance at `r_asked`; `noise` has one variance per observation."""
    if len(r_seen) == 0:
        return np.zeros(len(r_asked)), np.full(len(r_asked), signal)
    gram = covariance(r_seen, r_seen, length, signal) + np.diag(noise)
    cross = covariance(r_asked, r_seen, length, signal)
    mean = cross @ np.linalg.solve(gram, z_seen)
    return mean, signal - np.einsum("ij,ji->i", cross, np.linalg.solve(gram, cross.T))


def sector_consensus(r, z, seeds, caps, lent, length, signal, noise, t_model, t_data):
    """INSAC of one sector; `lent` holds (height, variance) or None for each prototype."""
    joined = list(np.flatnonzero(seeds))
    borrowed = []

    def model():
        seen = joined + borrowed
        heights = [z[j] for j in joined] + [lent[j][0] for j in borrowed]
        noises = [noise] * len(joined) + [lent[j][1] for j in borrowed]
        return regression(r[seen], np.array(heights), np.array(noises), r, length, signal)

    asked = 0
    while True:
        mean, variance = model()
        fits = np.abs(z - mean) < np.minimum(t_data * np.sqrt(noise + variance), caps)
        new = [j for j in np.flatnonzero(fits & (variance < t_model)) if j not in joined]
        if new and (joined or borrowed):
            joined += new
            continue
        while asked < len(r) and (variance[asked] < t_model or lent[asked] is None):
            asked += 1
        if asked == len(r):
            return np.isin(np.arange(len(r)), joined), mean, variance
        borrowed.append(asked)
        asked += 1


def lent_heights(ranges, heights, means, variances, t_model, reach, slope, gap):
    """What each prototype of each sector is lent: (height, variance), or None."""
    sectors = len(ranges)
    offers = [[None] * len(r) for r in ranges]
    for s in range(sectors):
        for i, r in enumerate(ranges[s]):
            if variances[s][i] < t_model or np.isnan(heights[s][i]):
                continue
            given = []
            for side in (-1, 1):
                for step in range(1, reach + 1):
                    t = (s + side * step) % sectors
                    near = np.abs(ranges[t] - r)
                    near[(variances[t] >= t_model) | (near >= gap)] = np.inf
                    if len(near) and np.isfinite(near.min()):
                        j = int(near.argmin())
                        across = (r * step * 2 * np.pi / sectors) ** 2 + near[j] ** 2
                        given.append((means[t][j], variances[t][j] + slope**2 * across))
                        break
            if given:
                weights = np.array([1 / variance for _, variance in given])
                mean = np.array([height for height, _ in given]) @ weights / weights.sum()
                offers[s][i] = (mean, 1 / weights.sum())
    return offers
