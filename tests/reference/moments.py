"""Moments of labelled points, part by part, from the definition."""

import numpy as np


def moments(points, labels, parts):
    """Count, mean and covariance (divided by the count) of the points under each label."""
    counts, means, covariances = [], [], []
    for part in range(parts):
        mine = [point for point, label in zip(points, labels, strict=True) if label == part]
        counts.append(len(mine))
        mean = sum(mine, np.zeros(3)) / max(len(mine), 1)
        scatter = sum((np.outer(p - mean, p - mean) for p in mine), np.zeros((3, 3)))
        means.append(mean)
        covariances.append(scatter / max(len(mine), 1))
    return np.array(counts), np.array(means), np.array(covariances)


def regularised(covariance, deviation, ratio=0.0):
    """The covariance with each principal variance raised to the floor, its axes kept."""
    variances, axes = np.linalg.eigh(covariance)
    least = max(deviation**2, ratio * max(variances))
    return sum(max(v, least) * np.outer(a, a) for v, a in zip(variances, axes.T, strict=True))
