"""Moments of labelled points by their definition, cluster by cluster."""

import numpy as np


def moments(points, labels, clusters):
    """Count, mean and covariance (divided by the count) of the points under each label."""
    counts, means, covariances = [], [], []
    for k in range(clusters):
        own = [point for point, label in zip(points, labels, strict=True) if label == k]
        counts.append(len(own))
        mean = sum(own, np.zeros(3)) / max(len(own), 1)
        scatter = sum((np.outer(p - mean, p - mean) for p in own), np.zeros((3, 3)))
        means.append(mean)
        covariances.append(scatter / max(len(own), 1))
    return np.array(counts), np.array(means), np.array(covariances)


def regularised(covariance, deviation, ratio=0.0):
    """Covariance with its principal variances raised to a minimum, and the same axes."""
    variances, axes = np.linalg.eigh(covariance)
    minimum = max(deviation**2, ratio * max(variances))
    return sum(max(v, minimum) * np.outer(a, a) for v, a in zip(variances, axes.T, strict=True))
