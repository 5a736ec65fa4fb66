"""The surface around a point by its definition: all distances, then NumPy's eigenvectors."""

import numpy as np


def neighbour_covariance(points, index, neighbours):
    """Covariance, divided by the count, of the points nearest to one of them."""
    distances = np.linalg.norm(points - points[index], axis=1)
    nearest = points[np.argsort(distances, kind="stable")[:neighbours]]
    return np.cov(nearest.T, bias=True)


def plane_covariances(points, neighbours, thinness):
    """Each neighbourhood's covariance with its eigenvalues replaced by (thinness, 1, 1)."""
    replaced = np.diag([thinness, 1.0, 1.0])
    full = []
    for index in range(len(points)):
        _, axes = np.linalg.eigh(neighbour_covariance(points, index, neighbours))
        full.append(axes @ replaced @ axes.T)
    return np.array(full)


def ellipsoid_covariances(points, neighbours, thinness):
    """Each neighbourhood's covariance scaled to a largest variance of 1, and floored."""
    full = []
    for index in range(len(points)):
        variances, axes = np.linalg.eigh(neighbour_covariance(points, index, neighbours))
        variances = np.maximum(variances / variances[-1], thinness)
        full.append(axes @ np.diag(variances) @ axes.T)
    return np.array(full)
