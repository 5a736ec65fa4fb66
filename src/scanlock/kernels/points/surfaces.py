"""Covariances of the neighbours of points."""

import numpy as np

from scanlock.arrays import Labels, Matrix, Points
from scanlock.kernels._compile import kernel


@kernel
def neighbour_covariances(points: Points, neighbours: Labels) -> Matrix:
    """Return the (n, 6) covariances of the points in each row of `neighbours` (n, k).

    Packed as xx, xy, xz, yy, yz, zz [m^2] and divided by k. Coordinates are relative to the first
    neighbour of the row, which loses no digits far from the origin.
    """
    n, k = neighbours.shape
    covariances = np.empty((n, 6))
    for i in range(n):
        o = neighbours[i, 0]
        o0, o1, o2 = points[o, 0], points[o, 1], points[o, 2]
        x = y = z = 0.0
        xx = xy = xz = yy = yz = zz = 0.0
        for j in range(1, k):
            p = neighbours[i, j]
            d0, d1, d2 = points[p, 0] - o0, points[p, 1] - o1, points[p, 2] - o2
            x += d0
            y += d1
            z += d2
            xx += d0 * d0
            xy += d0 * d1
            xz += d0 * d2
            yy += d1 * d1
            yz += d1 * d2
            zz += d2 * d2
        x /= k
        y /= k
        z /= k
        covariances[i, 0] = xx / k - x * x
        covariances[i, 1] = xy / k - x * y
        covariances[i, 2] = xz / k - x * z
        covariances[i, 3] = yy / k - y * y
        covariances[i, 4] = yz / k - y * z
        covariances[i, 5] = zz / k - z * z
    return covariances
