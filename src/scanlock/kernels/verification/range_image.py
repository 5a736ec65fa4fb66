"""Range image of a scan on the six faces of a cube around its origin, and free-space violation.

A direction belongs to the face of its largest component; the other two components, divided by it,
are the position on the face. This needs no arc tangent, and bins are equal to a factor of two.
"""

import math

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Matrix, Points, Vector
from scanlock.kernels._compile import helper, kernel
from scanlock.kernels._inline import nine, transformed, triple

_BLOCK = 256
"""Points whose bins are computed together, in loops that use vector units."""


@helper
def _bin_of(x: float, y: float, z: float, side: int) -> tuple[int, int, int]:
    """Return the face, row and column of the bin of a direction other than zero."""
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


@helper
def _bin_block(
    points: Points, start: int, side: int, scratch: Vector, bins: NDArray[np.int32], squares: Vector
) -> None:
    """Write the bin and the squared range of a block of points; the bin of zero is -1.

    As `_bin_of`, without a branch.
    """
    count = min(_BLOCK, points.shape[0] - start)
    for p in range(count):
        scratch[p] = points[start + p, 0]
        scratch[_BLOCK + p] = points[start + p, 1]
        scratch[2 * _BLOCK + p] = points[start + p, 2]
    half = 0.5 * side
    last = side - 1.0
    for p in range(_BLOCK):
        x, y, z = scratch[p], scratch[_BLOCK + p], scratch[2 * _BLOCK + p]
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
def build_range_image(points: Points, side: int) -> NDArray[np.float64]:
    """Return the (6, side, side) smallest range [m] in each bin, infinite in empty bins.

    Points (n, 3) [m] at zero have no direction and are left out.
    """
    n = points.shape[0]
    ranges = np.full(6 * side * side, math.inf)
    scratch, squares = np.zeros(3 * _BLOCK), np.zeros(_BLOCK)
    bins = np.zeros(_BLOCK, np.int32)
    for start in range(0, n, _BLOCK):
        _bin_block(points, start, side, scratch, bins, squares)
        for p in range(min(_BLOCK, n - start)):
            if bins[p] >= 0:
                ranges[bins[p]] = min(ranges[bins[p]], squares[p])
    for b in range(ranges.shape[0]):
        ranges[b] = math.sqrt(ranges[b])
    return ranges.reshape((6, side, side))


@kernel
def minimum_filtered(ranges: NDArray[np.float64], radius: int) -> NDArray[np.float64]:
    """Return the smallest range [m] within `radius` rows and columns on the same face.

    Empty bins stay infinite. `ranges` is (6, side, side) [m].
    """
    side = ranges.shape[1]
    filtered = np.empty(ranges.shape)
    in_row = np.empty((side, side))
    # The minimum over a square is the minimum over the minima of its rows.
    for face in range(6):
        for i in range(side):
            for j in range(side):
                in_row[i, j] = ranges[face, i, j]
            for shift in range(1, min(radius, side - 1) + 1):
                for j in range(side - shift):
                    in_row[i, j] = min(in_row[i, j], ranges[face, i, j + shift])
                for j in range(shift, side):
                    in_row[i, j] = min(in_row[i, j], ranges[face, i, j - shift])
        for i in range(side):
            for j in range(side):
                filtered[face, i, j] = in_row[i, j]
            for k in range(max(0, i - radius), min(side, i + radius + 1)):
                for j in range(side):
                    filtered[face, i, j] = min(filtered[face, i, j], in_row[k, j])
            for j in range(side):
                own = ranges[face, i, j]
                filtered[face, i, j] = filtered[face, i, j] if own < math.inf else math.inf
    return filtered


@kernel
def free_space_violation(
    ranges: NDArray[np.float64],
    points: Points,
    weights: Vector,
    rotation: Matrix,
    translation: Vector,
    margin: float,
    margin_ratio: float,
    hidden_margin: float,
    hidden_margin_ratio: float,
) -> tuple[int, float, float]:
    """Return the number and weight of the points a sensor can see, and the weight in free space.

    With the measured range R in its bin, a point at range r is visible unless it is hidden,
    ``r > R + hidden_margin + hidden_margin_ratio * R``. It is in free space if
    ``r < R - margin - margin_ratio * R``. Points in empty bins do not count.

    Parameters
    ----------
    ranges : (6, side, side) [m]
    points : (n, 3) [m]
    weights : (n,)
    rotation, translation : (3, 3), (3,) [m]
        Pose of the points in the frame of the range image.
    margin, hidden_margin : float [m]
    margin_ratio, hidden_margin_ratio : float

    Returns
    -------
    count : int
    visible_weight, violating_weight : float
    """
    side = ranges.shape[1]
    count = 0
    visible = 0.0
    violating = 0.0
    for p in range(points.shape[0]):
        x, y, z = points[p, 0], points[p, 1], points[p, 2]
        u, v, w = transformed(nine(rotation), triple(translation), x, y, z)
        squared = u * u + v * v + w * w
        if squared == 0.0:
            continue
        face, row, column = _bin_of(u, v, w, side)
        measured = ranges[face, row, column]
        if math.isinf(measured):
            continue
        distance = math.sqrt(squared)
        if distance > measured + hidden_margin + hidden_margin_ratio * measured:
            continue
        count += 1
        visible += weights[p]
        if distance < measured - margin - margin_ratio * measured:
            violating += weights[p]
    return count, visible, violating


@kernel
def measured_ranges(
    ranges: NDArray[np.float64], points: Points, rotation: Matrix, translation: Vector
) -> tuple[Vector, Vector]:
    """Return the range of each point (n, 3) from a sensor, and the range measured there [m].

    `ranges` is (6, side, side) [m]; the rotation and translation take the points into its frame.
    The measured range is infinite in empty bins and at the sensor itself.
    """
    side = ranges.shape[1]
    distances, measured = np.empty(points.shape[0]), np.empty(points.shape[0])
    for p in range(points.shape[0]):
        u, v, w = transformed(
            nine(rotation), triple(translation), points[p, 0], points[p, 1], points[p, 2]
        )
        distances[p] = math.sqrt(u * u + v * v + w * w)
        measured[p] = math.inf
        if distances[p] > 0.0:
            face, row, column = _bin_of(u, v, w, side)
            measured[p] = ranges[face, row, column]
    return distances, measured
