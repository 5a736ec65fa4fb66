"""How far a scan saw in every direction, on the six faces of a cube around its origin.

A direction falls on the face of its largest component; the other two, divided by it, are the
place on the face. That takes no arc tangent, and the bins are equal to a factor of two.
"""

import math

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Matrix, Points, Vector
from scanlock.kernels._compile import kernel

_BLOCK = 256
"""Points whose bins are computed at a time, for the sake of vector units."""


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
def _place_block(
    points: Points, start: int, side: int, place: Vector, bins: NDArray[np.int32], squares: Vector
) -> None:
    """Write the bin, -1 without one, and squared range of the points from `start` on.

    As `_place`, without a branch; `place` is scratch.
    """
    count = min(_BLOCK, points.shape[0] - start)
    for p in range(count):
        place[p] = points[start + p, 0]
        place[_BLOCK + p] = points[start + p, 1]
        place[2 * _BLOCK + p] = points[start + p, 2]
    half = 0.5 * side
    last = side - 1.0
    for p in range(_BLOCK):
        x, y, z = place[p], place[_BLOCK + p], place[2 * _BLOCK + p]
        a, b, c = abs(x), abs(y), abs(z)
        squared = x * x + y * y + z * z
        depth = max(a, max(b, c))
        along_x = a == depth
        along_y = b == depth
        u = y if along_x else x
        v = z if along_x or along_y else y
        face = 0.0 if along_x else (2.0 if along_y else 4.0)
        ahead = x if along_x else (y if along_y else z)
        face = face if ahead > 0.0 else face + 1.0
        depth = depth if squared > 0.0 else 1.0
        row = min(last, np.floor(half * (u / depth + 1.0)))
        column = min(last, np.floor(half * (v / depth + 1.0)))
        found = (face * side + row) * side + column
        found = found if squared > 0.0 else -1.0
        bins[p] = np.int32(found)
        squares[p] = squared


@kernel
def nearest_ranges(points: Points, side: int) -> NDArray[np.float64]:
    """Return the (6, side, side) ranges of the nearest point in each bin, infinite without any.

    Points at zero have no direction and are left out.
    """
    n = points.shape[0]
    ranges = np.full(6 * side * side, math.inf)
    place, squares = np.zeros(3 * _BLOCK), np.zeros(_BLOCK)
    bins = np.zeros(_BLOCK, np.int32)
    for start in range(0, n, _BLOCK):
        _place_block(points, start, side, place, bins, squares)
        for p in range(min(_BLOCK, n - start)):
            if bins[p] >= 0:
                ranges[bins[p]] = min(ranges[bins[p]], squares[p])
    for one in range(ranges.shape[0]):
        ranges[one] = math.sqrt(ranges[one])
    return ranges.reshape((6, side, side))


@kernel
def nearest_around(ranges: NDArray[np.float64], reach: int) -> NDArray[np.float64]:
    """Return the least range among the bins at most `reach` away on the same face.

    Bins without a point of their own stay infinite: nothing is known there.
    """
    side = ranges.shape[1]
    around = np.empty(ranges.shape)
    in_row = np.empty((side, side))
    # The least of a square is that of the least of its rows.
    for face in range(6):
        for i in range(side):
            for j in range(side):
                in_row[i, j] = ranges[face, i, j]
            for shift in range(1, min(reach, side - 1) + 1):
                for j in range(side - shift):
                    in_row[i, j] = min(in_row[i, j], ranges[face, i, j + shift])
                for j in range(shift, side):
                    in_row[i, j] = min(in_row[i, j], ranges[face, i, j - shift])
        for i in range(side):
            for j in range(side):
                around[face, i, j] = in_row[i, j]
            for k in range(max(0, i - reach), min(side, i + reach + 1)):
                for j in range(side):
                    around[face, i, j] = min(around[face, i, j], in_row[k, j])
            for j in range(side):
                own = ranges[face, i, j]
                around[face, i, j] = around[face, i, j] if own < math.inf else math.inf
    return around


@kernel
def free_space_violation(
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
