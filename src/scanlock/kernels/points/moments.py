"""Moments of labelled points."""

import numpy as np

from scanlock.arrays import Labels, Matrix, Points
from scanlock.kernels._compile import kernel


@kernel
def labelled_means(points: Points, labels: Labels, parts: int) -> tuple[Labels, Matrix]:
    """Return count (k,) and mean (k, 3) of the points under each label.

    Negative labels are skipped; an empty part has a zero mean.
    """
    counts = np.zeros(parts, np.int64)
    means = np.zeros((parts, 3))
    for i in range(points.shape[0]):
        k = labels[i]
        if k < 0:
            continue
        counts[k] += 1
        means[k, 0] += points[i, 0]
        means[k, 1] += points[i, 1]
        means[k, 2] += points[i, 2]
    for k in range(parts):
        if counts[k] > 0:
            for a in range(3):
                means[k, a] /= counts[k]
    return counts, means


@kernel
def labelled_moments(points: Points, labels: Labels, parts: int) -> tuple[Labels, Matrix, Matrix]:
    """Return count (k,), mean (k, 3) and covariance (k, 6) of the points under each label.

    Covariances are packed as xx, xy, xz, yy, yz, zz and divided by the count. Two passes, so
    that parts far from zero lose no digits. Negative labels are skipped; an empty part has
    zero moments.
    """
    counts, means = labelled_means(points, labels, parts)
    covariances = np.zeros((parts, 6))
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
    for k in range(parts):
        if counts[k] > 0:
            for a in range(6):
                covariances[k, a] /= counts[k]
    return counts, means, covariances
