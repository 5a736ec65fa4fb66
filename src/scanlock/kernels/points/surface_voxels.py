"""Mean points and mean surface covariances of voxels."""

import numpy as np

from scanlock.arrays import Labels, Matrix, Points
from scanlock.kernels._compile import kernel


@kernel
def voxel_averages(
    points: Points, covariances: Matrix, labels: Labels, count: int
) -> tuple[Points, Matrix]:
    """Return the mean (count, 3) of the points and (count, 6) of the covariances of each voxel.

    `labels` (n,) are the voxels of the points, numbered from 0 without gaps.
    """
    means, mean_covariances = np.zeros((count, 3)), np.zeros((count, 6))
    sizes = np.zeros(count, np.int64)
    for p in range(points.shape[0]):
        row = labels[p]
        sizes[row] += 1
        for axis in range(3):
            means[row, axis] += points[p, axis]
        for entry in range(6):
            mean_covariances[row, entry] += covariances[p, entry]
    for row in range(count):
        for axis in range(3):
            means[row, axis] /= sizes[row]
        for entry in range(6):
            mean_covariances[row, entry] /= sizes[row]
    return means, mean_covariances
