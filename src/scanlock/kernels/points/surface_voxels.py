"""Means of points, and of the covariances of their surfaces, by the voxel."""

import numpy as np

from scanlock.arrays import Labels, Matrix, Points
from scanlock.kernels._compile import kernel


@kernel
def voxel_surfaces(
    points: Points, covariances: Matrix, labels: Labels, count: int
) -> tuple[Points, Matrix]:
    """Return the mean (count, 3) of the points and (count, 6) of the covariances of each label."""
    means, spreads = np.zeros((count, 3)), np.zeros((count, 6))
    sizes = np.zeros(count, np.int64)
    for p in range(points.shape[0]):
        row = labels[p]
        sizes[row] += 1
        for axis in range(3):
            means[row, axis] += points[p, axis]
        for entry in range(6):
            spreads[row, entry] += covariances[p, entry]
    for row in range(count):
        for axis in range(3):
            means[row, axis] /= sizes[row]
        for entry in range(6):
            spreads[row, entry] /= sizes[row]
    return means, spreads
