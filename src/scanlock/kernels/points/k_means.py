"""Initial centres of k-means."""

import numpy as np

from scanlock.arrays import Labels, Points, Vector
from scanlock.kernels._compile import kernel


@kernel
def kmeans_plusplus(points: Points, draws: Vector) -> Labels:
    """Return a row of (n, 3) points for each of (k,) draws from [0, 1), by k-means++.

    The first row is drawn uniformly, each further one with a probability proportional to its
    squared distance to the rows drawn so far (Arthur and Vassilvitskii 2007). It is 0 if all
    points coincide with drawn ones.
    """
    n = points.shape[0]
    rows = np.zeros(draws.shape[0], np.int64)
    squared = np.full(n, np.inf)
    total = 0.0
    for s in range(draws.shape[0]):
        row = min(int(draws[s] * n), n - 1) if s == 0 else 0
        if s > 0:
            # The last row with a positive distance is taken where rounding leaves the sum short.
            target = draws[s] * total
            passed = 0.0
            for i in range(n):
                if squared[i] > 0.0:
                    row = i
                    passed += squared[i]
                    if passed > target:
                        break
        rows[s] = row
        x, y, z = points[row, 0], points[row, 1], points[row, 2]
        total = 0.0
        for i in range(n):
            dx, dy, dz = points[i, 0] - x, points[i, 1] - y, points[i, 2] - z
            squared[i] = min(squared[i], dx * dx + dy * dy + dz * dz)
            total += squared[i]
    return rows
