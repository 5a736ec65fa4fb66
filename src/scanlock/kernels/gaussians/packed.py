"""Symmetric matrices as (k, 6) packed upper triangles xx, xy, xz, yy, yz, zz."""

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector
from scanlock.kernels._compile import sum_kernel
from scanlock.kernels._inline import inverse, nine, put_symmetric, rotated, symmetric


@sum_kernel
def packed_inverses(packed: Matrix) -> Matrix:
    """Return the inverses of (k, 6) packed matrices; infinities or NaN for singular ones."""
    inverses = np.empty(packed.shape, np.float64)
    for k in range(packed.shape[0]):
        put_symmetric(inverses, k, inverse(symmetric(packed, k)))
    return inverses


@sum_kernel
def packed_rotated(packed: Matrix, rotation: Matrix) -> Matrix:
    """Return ``R C R'`` for each of (k, 6) packed matrices C."""
    r = nine(rotation)
    rotated_matrices = np.empty(packed.shape, np.float64)
    for k in range(packed.shape[0]):
        put_symmetric(rotated_matrices, k, rotated(r, symmetric(packed, k)))
    return rotated_matrices


@sum_kernel
def merged_moments(
    means: Points, packed: Matrix, weights: Vector, labels: Labels, components: int
) -> tuple[Points, Matrix, Vector]:
    """Return the moments of Gaussian mixtures, merged into one Gaussian each.

    Parameters
    ----------
    means : (k, 3) [m]
    packed : (k, 6) [m^2]
    weights : (k,)
    labels : (k,)
        Mixture that each Gaussian belongs to; each mixture has at least one.
    components : int
        Number of mixtures.

    Returns
    -------
    means : (components, 3) [m]
    packed : (components, 6) [m^2]
    weights : (components,)
    """
    total = np.zeros(components, np.float64)
    centres = np.zeros((components, 3), np.float64)
    covariances = np.zeros((components, 6), np.float64)
    for k in range(means.shape[0]):
        c = labels[k]
        total[c] += weights[k]
        for a in range(3):
            centres[c, a] += weights[k] * means[k, a]
    for c in range(components):
        for a in range(3):
            centres[c, a] /= total[c]
    for k in range(means.shape[0]):
        c = labels[k]
        ratio = weights[k] / total[c]
        x, y, z = (
            means[k, 0] - centres[c, 0],
            means[k, 1] - centres[c, 1],
            means[k, 2] - centres[c, 2],
        )
        covariances[c, 0] += ratio * (packed[k, 0] + x * x)
        covariances[c, 1] += ratio * (packed[k, 1] + x * y)
        covariances[c, 2] += ratio * (packed[k, 2] + x * z)
        covariances[c, 3] += ratio * (packed[k, 3] + y * y)
        covariances[c, 4] += ratio * (packed[k, 4] + y * z)
        covariances[c, 5] += ratio * (packed[k, 5] + z * z)
    return centres, covariances, total
