"""The covariance of a least squares estimate by its definition: solve again without each unit."""

import numpy as np


def minimum(jacobians, residuals, weights):
    """The step (p,) that makes the weighted squares of ``residuals + jacobians step`` least."""
    normal = np.einsum("n,na,nb->ab", weights, jacobians, jacobians)
    return -np.linalg.solve(normal, np.einsum("n,na,n->a", weights, jacobians, residuals))


def covariance(jacobians, residuals, weights, units):
    """Scatter of the minima that leave out one unit (n,) each, times (u - 1) / u."""
    found = [
        minimum(jacobians[units != one], residuals[units != one], weights[units != one])
        for one in np.unique(units)
    ]
    scatter = np.array(found) - np.mean(found, axis=0)
    return (len(found) - 1) / len(found) * scatter.T @ scatter
