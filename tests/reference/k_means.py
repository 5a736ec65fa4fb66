"""k-means from the definitions, point by point."""

import numpy as np


def spread_seeds(points, draws):
    """Rows drawn one by one, in proportion to the squared distance to the nearest drawn so far."""
    rows = [min(int(draws[0] * len(points)), len(points) - 1)]
    for draw in draws[1:]:
        gaps = np.linalg.norm(points[:, None] - points[rows], axis=2).min(axis=1) ** 2
        shares = np.cumsum(gaps)
        rows.append(int(np.flatnonzero(shares > draw * shares[-1])[0]))
    return rows


def spread(points, labels):
    """Sum of squared distances to the mean of the own part."""
    return sum(
        float(((points[labels == part] - points[labels == part].mean(axis=0)) ** 2).sum())
        for part in np.unique(labels)
    )
