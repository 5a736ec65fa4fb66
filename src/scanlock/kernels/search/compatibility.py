"""Compatibility graph of cluster matches, and the overlap of clusters under a pose.

The neighbours in the graph are bits of unsigned words of 64 bits. Symmetric 3x3 matrices are
packed as (m, 6) upper triangles xx, xy, xz, yy, yz, zz.
"""

import math

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Labels, Matrix, Points, Vector
from scanlock.kernels._compile import helper, kernel

Words = NDArray[np.uint64]


@kernel
def level_compatibility(
    target: Points,
    source: Points,
    target_covariances: Matrix,
    source_covariances: Matrix,
    turns: Matrix,
    tolerances: Vector,
    thresholds: Vector,
) -> Words:
    """Return the compatibility graph of m matches between levelled scans for each threshold.

    Two matches are neighbours if the sum of the squared misfits of height difference, horizontal
    distance and headings, in tolerances, is at most the threshold.

    Parameters
    ----------
    target, source : (m, 3) [m]
        Centres of the matched clusters.
    target_covariances, source_covariances : (m, 6) [m^2]
        Covariances of the centres between views.
    turns : (m, 2)
        Cosine and sine of twice the angle from source to target between the horizontal long axes
        of the clusters; zeros for a cluster without one.
    tolerances : (4,)
        Distance [m], height per distance, angle [rad], and the minimum distance of two centres [m].
    thresholds : (g,)
        Ascending.

    Returns
    -------
    (g, m, ceil(m / 64))
        Neighbours of each match as bits.
    """
    m = target.shape[0]
    graph = np.zeros((thresholds.shape[0], m, (m + 63) // 64), np.uint64)
    coordinates = np.zeros((2, 3, m))
    _fill_columns(coordinates, target, source, 2)
    bounds = _tolerance_bounds(target_covariances, source_covariances, tolerances[0])
    rows, excess = np.empty(m, np.int64), np.empty(m)
    for a in range(m):
        for k in range(_similar_distances(coordinates, bounds, thresholds[-1], a, excess, rows)):
            misfit = _level_misfit(
                target,
                source,
                target_covariances,
                source_covariances,
                turns,
                tolerances,
                a,
                rows[k],
            )
            _connect(graph, thresholds, misfit, a, rows[k])
    return graph


@kernel
def free_compatibility(
    target: Points,
    source: Points,
    target_covariances: Matrix,
    source_covariances: Matrix,
    target_axes: Points,
    source_axes: Points,
    tolerances: Vector,
    thresholds: Vector,
) -> Words:
    """Return the compatibility graph of m matches between frames with any roll and pitch.

    The misfits are those of the distance of the centres, and of the angles among the axes of the
    clusters and the line through the centres. They are invariant to rotations.

    Parameters
    ----------
    target, source, target_covariances, source_covariances, tolerances, thresholds
        As in `level_compatibility`; the height per distance is not used.
    target_axes, source_axes : (m, 3)
        Unit vectors of either sign; zeros for a cluster without an axis.

    Returns
    -------
    (g, m, ceil(m / 64))
        Neighbours of each match as bits.
    """
    m = target.shape[0]
    graph = np.zeros((thresholds.shape[0], m, (m + 63) // 64), np.uint64)
    coordinates = np.empty((2, 3, m))
    _fill_columns(coordinates, target, source, 3)
    bounds = _tolerance_bounds(target_covariances, source_covariances, tolerances[0])
    rows, excess = np.empty(m, np.int64), np.empty(m)
    for a in range(m):
        for k in range(_similar_distances(coordinates, bounds, thresholds[-1], a, excess, rows)):
            misfit = _free_misfit(
                target, source, target_covariances, source_covariances, target_axes, source_axes,
                tolerances, a, rows[k],
            )  # fmt: skip
            _connect(graph, thresholds, misfit, a, rows[k])
    return graph


@kernel
def soft_overlap(target: Points, source: Points, affinities: Matrix, deviation: float) -> float:
    """Return the soft number of source clusters that overlap a similar target cluster.

    A source cluster counts with its best target cluster, by distance and affinity. A target
    cluster counts once.

    Parameters
    ----------
    target : (k, 3) [m]
    source : (n, 3) [m]
        In the target's frame.
    affinities : (n, k)
        Similarity of two clusters, 0 to 1.
    deviation : float [m]
        Standard deviation of the Gaussian weight of a distance; the weight is zero beyond three
        deviations.
    """
    taken = np.zeros(target.shape[0])
    max_square = 9.0 * deviation * deviation
    total = 0.0
    for n in range(source.shape[0]):
        best, at = 0.0, -1
        for k in range(target.shape[0]):
            x, y = target[k, 0] - source[n, 0], target[k, 1] - source[n, 1]
            z = target[k, 2] - source[n, 2]
            square = x * x + y * y + z * z
            if square < max_square and affinities[n, k] > best:
                count = affinities[n, k] * math.exp(-0.5 * square / (deviation * deviation))
                if count > best:
                    best, at = count, k
        if at >= 0 and best > taken[at]:
            total += best - taken[at]
            taken[at] = best
    return total


@helper
def _fill_columns(coordinates: Matrix, target: Points, source: Points, count: int) -> None:
    """Write the first columns of both as rows.

    In a loop, because assigning slices compiles Numba's error formatting, which takes a second.
    """
    for row in range(target.shape[0]):
        for axis in range(count):
            coordinates[0, axis, row], coordinates[1, axis, row] = (
                target[row, axis],
                source[row, axis],
            )


@helper
def _tolerance_bounds(
    target_covariances: Matrix, source_covariances: Matrix, base: float
) -> Vector:
    """Return the contribution of each match to a bound of the squared distance tolerance."""
    bounds = np.empty(target_covariances.shape[0])
    for a in range(bounds.shape[0]):
        bounds[a] = (
            0.5 * base * base
            + target_covariances[a, 0]
            + target_covariances[a, 3]
            + target_covariances[a, 5]
        )
        bounds[a] += source_covariances[a, 0] + source_covariances[a, 3] + source_covariances[a, 5]
    return bounds


@helper
def _similar_distances(
    coordinates: Matrix, bounds: Vector, max_threshold: float, a: int, excess: Vector, rows: Labels
) -> int:
    """Write the matches before `a` that may be its neighbours into `rows`; return their number.

    Nine of ten are excluded by their distances alone, in a loop without branches. The trace of a
    covariance is an upper bound of its variance along any direction. `coordinates` (2, 3, m) are
    x, y, z of target and source; `excess` is scratch memory.
    """
    for b in range(a):
        x, y, z = (
            coordinates[0, 0, a] - coordinates[0, 0, b],
            coordinates[0, 1, a] - coordinates[0, 1, b],
            coordinates[0, 2, a] - coordinates[0, 2, b],
        )
        u, v, w = (
            coordinates[1, 0, a] - coordinates[1, 0, b],
            coordinates[1, 1, a] - coordinates[1, 1, b],
            coordinates[1, 2, a] - coordinates[1, 2, b],
        )
        difference = math.sqrt(x * x + y * y + z * z) - math.sqrt(u * u + v * v + w * w)
        excess[b] = difference * difference - max_threshold * (bounds[a] + bounds[b])
    count = 0
    for b in range(a):
        rows[count] = b
        count += excess[b] <= 0.0
    return count


@helper
def _level_misfit(
    target: Points,
    source: Points,
    target_covariances: Matrix,
    source_covariances: Matrix,
    turns: Matrix,
    tolerances: Vector,
    a: int,
    b: int,
) -> float:
    base, slope, angle, min_distance = tolerances[0], tolerances[1], tolerances[2], tolerances[3]
    base *= base
    tx, ty = target[a, 0] - target[b, 0], target[a, 1] - target[b, 1]
    sx, sy = source[a, 0] - source[b, 0], source[a, 1] - source[b, 1]
    far_t, far_s = math.sqrt(tx * tx + ty * ty), math.sqrt(sx * sx + sy * sy)
    if far_t < min_distance or far_s < min_distance:
        return math.inf
    rise = target[a, 2] - target[b, 2] - source[a, 2] + source[b, 2]
    upward = target_covariances[a, 5] + target_covariances[b, 5]
    upward = upward + source_covariances[a, 5] + source_covariances[b, 5]
    misfit = rise * rise / (base + slope * slope * far_t * far_t + upward)
    tx, ty, sx, sy = tx / far_t, ty / far_t, sx / far_s, sy / far_s
    along = _variance(target_covariances, a, b, tx, ty, 0.0) + _variance(
        source_covariances, a, b, sx, sy, 0.0
    )
    misfit += (far_t - far_s) ** 2 / (base + along)
    across = _variance(target_covariances, a, b, -ty, tx, 0.0) + _variance(
        source_covariances, a, b, -sy, sx, 0.0
    )
    variance = angle * angle + (base + across) / (far_t * far_s)
    # Twice the angle between the lines through the centres, since axes and lines have no sign.
    c, s = tx * sx + ty * sy, ty * sx - tx * sy
    c, s = c * c - s * s, 2.0 * c * s
    has_a = turns[a, 0] != 0.0 or turns[a, 1] != 0.0
    has_b = turns[b, 0] != 0.0 or turns[b, 1] != 0.0
    # sin(x)^2 = (1 - cos(2 x)) / 2.
    if has_a:
        misfit += 0.5 * (1.0 - turns[a, 0] * c - turns[a, 1] * s) / variance
    if has_b:
        misfit += 0.5 * (1.0 - turns[b, 0] * c - turns[b, 1] * s) / variance
    if has_a and has_b:
        cosine = turns[a, 0] * turns[b, 0] + turns[a, 1] * turns[b, 1]
        misfit += 0.25 * (1.0 - cosine) / (angle * angle)
    return misfit


@helper
def _free_misfit(
    target: Points,
    source: Points,
    target_covariances: Matrix,
    source_covariances: Matrix,
    target_axes: Points,
    source_axes: Points,
    tolerances: Vector,
    a: int,
    b: int,
) -> float:
    base, angle, min_distance = tolerances[0], tolerances[2], tolerances[3]
    base *= base
    tx, ty, tz = (
        target[a, 0] - target[b, 0], target[a, 1] - target[b, 1], target[a, 2] - target[b, 2],
    )  # fmt: skip
    sx, sy, sz = (
        source[a, 0] - source[b, 0], source[a, 1] - source[b, 1], source[a, 2] - source[b, 2],
    )  # fmt: skip
    far_t, far_s = math.sqrt(tx * tx + ty * ty + tz * tz), math.sqrt(sx * sx + sy * sy + sz * sz)
    if far_t < min_distance or far_s < min_distance:
        return math.inf
    tx, ty, tz, sx, sy, sz = tx / far_t, ty / far_t, tz / far_t, sx / far_s, sy / far_s, sz / far_s
    along = _variance(target_covariances, a, b, tx, ty, tz) + _variance(
        source_covariances, a, b, sx, sy, sz
    )
    misfit = (far_t - far_s) ** 2 / (base + along)
    across = _trace(target_covariances, a, b) + _trace(source_covariances, a, b) - along
    # Of the two directions perpendicular to the line, one changes its angle to the axis.
    variance = angle * angle + (base + 0.5 * across) / (far_t * far_s)
    ta, tb = _axis_cosine(target_axes, a, tx, ty, tz), _axis_cosine(target_axes, b, tx, ty, tz)
    sa, sb = _axis_cosine(source_axes, a, sx, sy, sz), _axis_cosine(source_axes, b, sx, sy, sz)
    t_axes = _axis_cosine(target_axes, a, target_axes[b, 0], target_axes[b, 1], target_axes[b, 2])
    s_axes = _axis_cosine(source_axes, a, source_axes[b, 0], source_axes[b, 1], source_axes[b, 2])
    misfit += ((ta - sa) ** 2 + (tb - sb) ** 2) / variance
    return misfit + 0.5 * (t_axes - s_axes) ** 2 / (angle * angle)


@helper
def _variance(c: Matrix, a: int, b: int, x: float, y: float, z: float) -> float:
    """Return the sum of the variances of two centres along a unit vector; `c` (m, 6) is packed."""
    mixed = (c[a, 1] + c[b, 1]) * x * y
    mixed += (c[a, 2] + c[b, 2]) * x * z + (c[a, 4] + c[b, 4]) * y * z
    total = (c[a, 0] + c[b, 0]) * x * x + (c[a, 3] + c[b, 3]) * y * y
    return total + (c[a, 5] + c[b, 5]) * z * z + 2.0 * mixed


@helper
def _trace(c: Matrix, a: int, b: int) -> float:
    return c[a, 0] + c[b, 0] + c[a, 3] + c[b, 3] + c[a, 5] + c[b, 5]


@helper
def _axis_cosine(axes: Points, row: int, x: float, y: float, z: float) -> float:
    """Return the absolute cosine of the angle between an axis and a line."""
    return abs(axes[row, 0] * x + axes[row, 1] * y + axes[row, 2] * z)


@helper
def _connect(graph: Words, thresholds: Vector, misfit: float, a: int, b: int) -> None:
    for g in range(thresholds.shape[0] - 1, -1, -1):
        if misfit > thresholds[g]:
            break
        graph[g, a, b >> 6] |= np.uint64(1) << np.uint64(b & 63)
        graph[g, b, a >> 6] |= np.uint64(1) << np.uint64(a & 63)
