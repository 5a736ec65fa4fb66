"""Which Gaussians of one scan meet a Gaussian of the other."""

import numpy as np

from scanlock.arrays import Mask, Matrix, Points, Vector
from scanlock.kernels._compile import kernel


@kernel
def meeting_gaussians(
    target_means: Points,
    target_covariances: Matrix,
    target_widths: Vector,
    source_means: Points,
    source_covariances: Matrix,
    source_widths: Vector,
    limit: float,
) -> Mask:
    """Return (m,) whether any target lies within squared distance `limit` of each source.

    The squared distance of two means is taken under the sum of their covariances, (k, 6) packed
    upper triangles; both sets are in one frame. Widths are the largest variances.
    """
    met = np.zeros(source_means.shape[0], np.bool_)
    for i in range(source_means.shape[0]):
        for j in range(target_means.shape[0]):
            q0 = source_means[i, 0] - target_means[j, 0]
            q1 = source_means[i, 1] - target_means[j, 1]
            q2 = source_means[i, 2] - target_means[j, 2]
            reach = limit * (source_widths[i] + target_widths[j])
            if q0 * q0 + q1 * q1 + q2 * q2 > reach:
                continue
            s00 = source_covariances[i, 0] + target_covariances[j, 0]
            s01 = source_covariances[i, 1] + target_covariances[j, 1]
            s02 = source_covariances[i, 2] + target_covariances[j, 2]
            s11 = source_covariances[i, 3] + target_covariances[j, 3]
            s12 = source_covariances[i, 4] + target_covariances[j, 4]
            s22 = source_covariances[i, 5] + target_covariances[j, 5]
            a00 = s11 * s22 - s12 * s12
            a01 = s02 * s12 - s01 * s22
            a02 = s01 * s12 - s02 * s11
            a11 = s00 * s22 - s02 * s02
            a12 = s01 * s02 - s00 * s12
            a22 = s00 * s11 - s01 * s01
            determinant = s00 * a00 + s01 * a01 + s02 * a02
            scaled = (
                q0 * (a00 * q0 + 2.0 * (a01 * q1 + a02 * q2))
                + q1 * (a11 * q1 + 2.0 * a12 * q2)
                + a22 * q2 * q2
            )
            if scaled < limit * determinant:
                met[i] = True
                break
    return met
