"""How far a scan saw in every direction, on the six faces of a cube around its origin.

A direction falls on the face of its largest component; the other two, divided by it, are the
place on the face. That takes no arc tangent, and the bins are equal to a factor of two.
"""

import math

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Matrix, Points, Vector
from scanlock.kernels._compile import kernel


@kernel
def _place(x: float, y: float, z: float, side: int) -> tuple[int, int, int]:
    """Return the face, row and column of the bin of a direction that is not zero."""
    a, b, c = abs(x), abs(y), abs(z)
    if a >= b and a >= c:
        face, depth, u, v = 0 if x > 0.0 else 1, a, y, z
    elif b >= c:
        face, depth, u, v = 2 if y > 0.0 else 3, b, x, z
    else:
        face, depth, u, v = 4 if z > 0.0 else 5, c, x, y
    half = 0.5 * side
    row = min(side - 1, int(half * (u / depth + 1.0)))
    column = min(side - 1, int(half * (v / depth + 1.0)))
    return face, row, column


@kernel
def nearest_ranges(points: Points, side: int) -> NDArray[np.float64]:
    """Return the (6, side, side) ranges of the nearest point in each bin, infinite without any.

    Points at zero have no direction and are left out.
    """
    ranges = np.full((6, side, side), math.inf)
    for p in range(points.shape[0]):
        x, y, z = points[p, 0], points[p, 1], points[p, 2]
        squared = x * x + y * y + z * z
        if squared == 0.0:
            continue
        face, row, column = _place(x, y, z, side)
        ranges[face, row, column] = min(ranges[face, row, column], squared)
    return np.sqrt(ranges)


@kernel
def nearest_around(ranges: NDArray[np.float64], reach: int) -> NDArray[np.float64]:
    """Return the least range among the bins at most `reach` away on the same face.

    Bins without a point of their own stay infinite: nothing is known there.
    """
    side = ranges.shape[1]
    around = np.full(ranges.shape, math.inf)
    for face in range(6):
        for i in range(side):
            for j in range(side):
                if math.isinf(ranges[face, i, j]):
                    continue
                least = math.inf
                for k in range(max(0, i - reach), min(side, i + reach + 1)):
                    for m in range(max(0, j - reach), min(side, j + reach + 1)):
                        least = min(least, ranges[face, k, m])
                around[face, i, j] = least
    return around


@kernel
def looked_through(
    ranges: NDArray[np.float64],
    points: Points,
    weights: Vector,
    rotation: Matrix,
    translation: Vector,
    margin: float,
    share: float,
    hidden_margin: float,
    hidden_share: float,
) -> tuple[int, float, float]:
    """Return how many points could be seen, their weight, and the weight of those well before.

    In a bin that knows a range R, a point at range r could be seen unless it is well behind,
    ``r > R + hidden_margin + hidden_share * R``; it is well before where
    ``r < R - margin - share * R``.
    """
    side = ranges.shape[1]
    count = 0
    known = 0.0
    before = 0.0
    for p in range(points.shape[0]):
        x, y, z = points[p, 0], points[p, 1], points[p, 2]
        u = rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z + translation[0]
        v = rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z + translation[1]
        w = rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z + translation[2]
        squared = u * u + v * v + w * w
        if squared == 0.0:
            continue
        face, row, column = _place(u, v, w, side)
        seen = ranges[face, row, column]
        if math.isinf(seen):
            continue
        distance = math.sqrt(squared)
        if distance > seen + hidden_margin + hidden_share * seen:
            continue
        count += 1
        known += weights[p]
        if distance < seen - margin - share * seen:
            before += weights[p]
    return count, known, before
