"""Jackknife covariance of a least squares estimate by definition: solve without each block."""

import numpy as np


def minimum(jacobians, residuals, weights):
    """Step (p,) of the least weighted squares of ``residuals + jacobians step``."""
    normal = np.einsum("n,na,nb->ab", weights, jacobians, jacobians)
    return -np.linalg.solve(normal, np.einsum("n,na,n->a", weights, jacobians, residuals))


def covariance(jacobians, residuals, weights, blocks):
    """Scatter of the minima that leave out one of u blocks (n,) each, times (u - 1) / u."""
    found = [
        minimum(jacobians[blocks != one], residuals[blocks != one], weights[blocks != one])
        for one in np.unique(blocks)
    ]
    scatter = np.array(found) - np.mean(found, axis=0)
    return (len(found) - 1) / len(found) * scatter.T @ scatter
