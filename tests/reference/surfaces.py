"""Surface covariances by their definition: all distances, and the eigenvectors of NumPy."""

import numpy as np


def neighbour_covariance(points, index, neighbours):
    """Covariance, divided by the count, of the nearest neighbours of a point."""
    distances = np.linalg.norm(points - points[index], axis=1)
    nearest = points[np.argsort(distances, kind="stable")[:neighbours]]
    return np.cov(nearest.T, bias=True)


def plane_covariances(points, neighbours, epsilon):
    """Covariance of each neighbourhood, its eigenvalues replaced by (epsilon, 1, 1)."""
    replaced = np.diag([epsilon, 1.0, 1.0])
    full = []
    for index in range(len(points)):
        _, axes = np.linalg.eigh(neighbour_covariance(points, index, neighbours))
        full.append(axes @ replaced @ axes.T)
    return np.array(full)


def ellipsoid_covariances(points, neighbours, epsilon):
    """Covariance of each neighbourhood, scaled to a largest variance of 1 and regularised."""
    full = []
    for index in range(len(points)):
        variances, axes = np.linalg.eigh(neighbour_covariance(points, index, neighbours))
        variances = np.maximum(variances / variances[-1], epsilon)
        full.append(axes @ np.diag(variances) @ axes.T)
    return np.array(full)
