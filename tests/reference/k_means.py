"""k-means by its definition, point by point."""

import numpy as np


def kmeans_plusplus(points, draws):
    """Rows drawn in proportion to the squared distance to the nearest previous one."""
    rows = [min(int(draws[0] * len(points)), len(points) - 1)]
    for draw in draws[1:]:
        squares = np.linalg.norm(points[:, None] - points[rows], axis=2).min(axis=1) ** 2
        sums = np.cumsum(squares)
        rows.append(int(np.flatnonzero(sums > draw * sums[-1])[0]))
    return rows


def sum_of_squares(points, labels):
    """Sum of squared distances to the mean of the own cluster."""
    return sum(
        float(((points[labels == k] - points[labels == k].mean(axis=0)) ** 2).sum())
        for k in np.unique(labels)
    )
