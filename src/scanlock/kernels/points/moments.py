"""Means and covariances of labelled points."""

import numpy as np

from scanlock.arrays import Labels, Matrix, Points
from scanlock.kernels._compile import kernel


@kernel
def labelled_means(points: Points, labels: Labels, groups: int) -> tuple[Labels, Matrix]:
    """Return the count (k,) and mean (k, 3) [m] of the points of each label.

    Negative labels are skipped; the mean of an empty group is zero.
    """
    counts = np.zeros(groups, np.int64)
    means = np.zeros((groups, 3))
    for i in range(points.shape[0]):
        k = labels[i]
        if k < 0:
            continue
        counts[k] += 1
        means[k, 0] += points[i, 0]
        means[k, 1] += points[i, 1]
        means[k, 2] += points[i, 2]
    for k in range(groups):
        if counts[k] > 0:
            for a in range(3):
                means[k, a] /= counts[k]
    return counts, means


@kernel
def labelled_moments(points: Points, labels: Labels, groups: int) -> tuple[Labels, Matrix, Matrix]:
    """Return the count (k,), mean (k, 3) [m] and covariance (k, 6) [m^2] of each label's points.

    Covariances are packed as xx, xy, xz, yy, yz, zz and divided by the count. They are computed
    in two passes, which lose no digits far from the origin. Negative labels are skipped; the
    moments of an empty group are zero.
    """
    counts, means = labelled_means(points, labels, groups)
    covariances = np.zeros((groups, 6))
    for i in range(points.shape[0]):
        k = labels[i]
        if k < 0:
            continue
        x = points[i, 0] - means[k, 0]
        y = points[i, 1] - means[k, 1]
        z = points[i, 2] - means[k, 2]
        covariances[k, 0] += x * x
        covariances[k, 1] += x * y
        covariances[k, 2] += x * z
        covariances[k, 3] += y * y
        covariances[k, 4] += y * z
        covariances[k, 5] += z * z
    for k in range(groups):
        if counts[k] > 0:
            for a in range(6):
                covariances[k, a] /= counts[k]
    return counts, means, covariances
