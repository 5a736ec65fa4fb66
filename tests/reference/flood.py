"""Greedy clustering as section V of Das et al. 2013 writes it, and its tests Phi.

Starting from a random unvisited bin, neighbours in Theta are merged as long as Phi allows,
with a list of open bins, until every bin is visited.
"""

import numpy as np
from scipy.stats import multivariate_normal

from reference import polar
from reference.moments import regularised


def bins_of(points, sectors, edges):
    """The rows in each occupied (sector, ring)."""
    bins = {}
    rings = len(edges) - 1
    for row, (x, y, _) in enumerate(points):
        cell = polar.cell(x, y, sectors, edges)
        if cell >= 0:
            bins.setdefault(divmod(cell, rings), []).append(row)
    return bins


def neighbours(cell, sectors, rings):
    """Theta: the eight bins around one; azimuth wraps, range does not."""
    sector, ring = cell
    for sector_step in (-1, 0, 1):
        for ring_step in (-1, 0, 1):
            if (sector_step, ring_step) != (0, 0) and 0 <= ring + ring_step < rings:
                yield (sector + sector_step) % sectors, ring + ring_step


def flood(points, sectors, edges, combine, rng):
    """The sets of rows that grow together, from bins visited in random order."""
    bins = bins_of(points, sectors, edges)
    unvisited = set(bins)
    clusters = set()
    for i in rng.permutation(len(bins)):
        seed = sorted(bins)[i]
        if seed not in unvisited:
            continue
        unvisited.remove(seed)
        opened, cluster = [seed], []
        while opened:
            current = opened.pop(int(rng.integers(len(opened))))
            cluster += bins[current]
            for other in neighbours(current, sectors, len(edges) - 1):
                if other in unvisited and combine(points[bins[current]], points[bins[other]]):
                    unvisited.remove(other)
                    opened.append(other)
        clusters.add(frozenset(cluster))
    return clusters


def covariance(points):
    gaps = points - points.mean(axis=0)
    return gaps.T @ gaps / len(points)


def means_are_close(first, second, limit):
    return np.linalg.norm(first.mean(axis=0) - second.mean(axis=0)) < limit


def correlation(first_mean, first_covariance, second_mean, second_covariance):
    """``int f g / sqrt(int f^2 int g^2)`` of two normal densities f and g."""

    def overlap(a, s, b, t):
        return multivariate_normal.pdf(a, mean=b, cov=s + t)

    f, g = (first_mean, first_covariance), (second_mean, second_covariance)
    return overlap(*f, *g) / np.sqrt(overlap(*f, *f) * overlap(*g, *g))


def densities_correlate(first, second, least_correlation, min_deviation):
    f, g = (
        (part.mean(axis=0), regularised(covariance(part), min_deviation))
        for part in (first, second)
    )
    return correlation(*f, *g) > least_correlation


def one_gaussian_fits(first, second, limit, min_deviation):
    """Whether the means lie within `limit` deviations of the scatter about their own means."""
    both = np.concatenate([first - first.mean(axis=0), second - second.mean(axis=0)])
    pooled = regularised(both.T @ both / len(both), min_deviation)
    gap = first.mean(axis=0) - second.mean(axis=0)
    return np.sqrt(gap @ np.linalg.inv(pooled) @ gap) < limit
