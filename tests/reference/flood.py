"""Greedy clustering by its definition, section V of Das et al. 2013, and its tests Phi.

From a random unvisited bin, neighbours in Theta are merged as long as Phi allows, with a list of
open bins, until every bin is visited.
"""

import numpy as np
from scipy.stats import multivariate_normal

from reference import polar
from reference.moments import regularised


def bins_of(points, sectors, edges):
    """Rows of the points in each occupied (sector, ring)."""
    bins = {}
    rings = len(edges) - 1
    for row, (x, y, _) in enumerate(points):
        cell = polar.cell(x, y, sectors, edges)
        if cell >= 0:
            bins.setdefault(divmod(cell, rings), []).append(row)
    return bins


def neighbours(cell, sectors, rings):
    """Theta: the eight neighbours of a bin; azimuth wraps, range does not."""
    sector, ring = cell
    for sector_step in (-1, 0, 1):
        for ring_step in (-1, 0, 1):
            if (sector_step, ring_step) != (0, 0) and 0 <= ring + ring_step < rings:
                yield (sector + sector_step) % sectors, ring + ring_step


def flood(points, sectors, edges, combine, rng):
    """Sets of rows of the clusters grown from bins in random order."""
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
    centred = points - points.mean(axis=0)
    return centred.T @ centred / len(points)


def means_are_close(first, second, max_distance):
    return np.linalg.norm(first.mean(axis=0) - second.mean(axis=0)) < max_distance


def correlation(first_mean, first_covariance, second_mean, second_covariance):
    """``int f g / sqrt(int f^2 int g^2)`` of two normal densities f and g."""

    def overlap(a, s, b, t):
        return multivariate_normal.pdf(a, mean=b, cov=s + t)

    f, g = (first_mean, first_covariance), (second_mean, second_covariance)
    return overlap(*f, *g) / np.sqrt(overlap(*f, *f) * overlap(*g, *g))


def densities_correlate(first, second, min_correlation, min_deviation):
    f, g = (
        (points.mean(axis=0), regularised(covariance(points), min_deviation))
        for points in (first, second)
    )
    return correlation(*f, *g) > min_correlation


def one_gaussian_fits(first, second, max_mahalanobis, min_deviation):
    """Whether the Mahalanobis distance of the means by the pooled covariance is small."""
    both = np.concatenate([first - first.mean(axis=0), second - second.mean(axis=0)])
    pooled = regularised(both.T @ both / len(both), min_deviation)
    difference = first.mean(axis=0) - second.mean(axis=0)
    return np.sqrt(difference @ np.linalg.inv(pooled) @ difference) < max_mahalanobis
