"""Which matches of parts can hold at once, and how well parts meet under a pose.

Neighbours in the graph are kept as bits of unsigned words, 64 to a word. Symmetric 3x3
matrices come as (m, 6) upper triangles xx, xy, xz, yy, yz, zz.
"""

import math

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Labels, Matrix, Points, Vector
from scanlock.kernels._compile import kernel

Words = NDArray[np.uint64]


@kernel
def level_compatibility(
    target: Points,
    source: Points,
    target_slack: Matrix,
    source_slack: Matrix,
    turns: Matrix,
    tolerances: Vector,
    grades: Vector,
) -> Words:
    """Return the (g, m, w) neighbours of m matches between level frames, at each grade.

    Two matches are neighbours if the squared misfits of their height difference, horizontal
    distance and headings, in tolerances, sum to no more than the grade.

    Parameters
    ----------
    target, source : (m, 3) [m]
        Centres of the matched parts.
    target_slack, source_slack : (m, 6) [m^2]
        How far a centre may slide along each direction, squared.
    turns : (m, 2)
        Cosine and sine of twice the turn from source to target of the parts' long axes seen
        from above; zeros where a part has none.
    tolerances : (4,)
        Distance [m], height per distance, angle [rad], least distance [m] of two centres.
    grades : (g,)
        Ascending.
    """
    m = target.shape[0]
    graph = np.zeros((grades.shape[0], m, (m + 63) // 64), np.uint64)
    places = np.zeros((2, 3, m))
    _fill_columns(places, target, source, 2)
    room = _room(target_slack, source_slack, tolerances[0])
    rows, excess = np.empty(m, np.int64), np.empty(m)
    for a in range(m):
        for k in range(_evenly_far(places, room, grades[-1], a, excess, rows)):
            outlier_ratio = _level_misfit(
                target, source, target_slack, source_slack, turns, tolerances, a, rows[k]
            )
            _join(graph, grades, outlier_ratio, a, rows[k])
    return graph


@kernel
def free_compatibility(
    target: Points,
    source: Points,
    target_slack: Matrix,
    source_slack: Matrix,
    target_axes: Points,
    source_axes: Points,
    tolerances: Vector,
    grades: Vector,
) -> Words:
    """Return the (g, m, w) neighbours of m matches between frames of any tilt, at each grade.

    The misfits are those of the distance of the centres and of the angles among the parts' axes
    and the line that joins the centres; no rotation changes them.

    Parameters
    ----------
    target, source, target_slack, source_slack, tolerances, grades
        As in `level_compatibility`; the height per distance is not used.
    target_axes, source_axes : (m, 3)
        Unit vectors whose sign means nothing; zeros where a part has none.
    """
    m = target.shape[0]
    graph = np.zeros((grades.shape[0], m, (m + 63) // 64), np.uint64)
    places = np.empty((2, 3, m))
    _fill_columns(places, target, source, 3)
    room = _room(target_slack, source_slack, tolerances[0])
    rows, excess = np.empty(m, np.int64), np.empty(m)
    for a in range(m):
        for k in range(_evenly_far(places, room, grades[-1], a, excess, rows)):
            outlier_ratio = _free_misfit(
                target, source, target_slack, source_slack, target_axes, source_axes,
                tolerances, a, rows[k],
            )  # fmt: skip
            _join(graph, grades, outlier_ratio, a, rows[k])
    return graph


@kernel
def soft_overlap(target: Points, source: Points, affinities: Matrix, width: float) -> float:
    """Return how many parts meet their like, each counted by how near and how alike.

    A source part meets the target part that counts most; a target part counts once.

    Parameters
    ----------
    target : (k, 3) [m]
    source : (n, 3) [m]
        In the target's frame.
    affinities : (n, k)
        How alike two parts are, 0 to 1.
    width : float [m]
        Deviation of the Gaussian by which nearness falls off; zero beyond three of it.
    """
    taken = np.zeros(target.shape[0])
    reach = 9.0 * width * width
    total = 0.0
    for n in range(source.shape[0]):
        best, at = 0.0, -1
        for k in range(target.shape[0]):
            x, y = target[k, 0] - source[n, 0], target[k, 1] - source[n, 1]
            z = target[k, 2] - source[n, 2]
            square = x * x + y * y + z * z
            if square < reach and affinities[n, k] > best:
                count = affinities[n, k] * math.exp(-0.5 * square / (width * width))
                if count > best:
                    best, at = count, k
        if at >= 0 and best > taken[at]:
            total += best - taken[at]
            taken[at] = best
    return total


@kernel
def _fill_columns(places: Matrix, target: Points, source: Points, count: int) -> None:
    """Write the first columns of both as rows.

    In a loop: assigning slices compiles Numba's formatting of errors, for a second.
    """
    for row in range(target.shape[0]):
        for axis in range(count):
            places[0, axis, row], places[1, axis, row] = target[row, axis], source[row, axis]


@kernel
def _room(target_slack: Matrix, source_slack: Matrix, base: float) -> Vector:
    """Return a bound on what each match adds to the squared tolerance of a distance."""
    room = np.empty(target_slack.shape[0])
    for a in range(room.shape[0]):
        room[a] = 0.5 * base * base + target_slack[a, 0] + target_slack[a, 3] + target_slack[a, 5]
        room[a] += source_slack[a, 0] + source_slack[a, 3] + source_slack[a, 5]
    return room


@kernel
def _evenly_far(
    places: Matrix, room: Vector, most: float, a: int, excess: Vector, rows: Labels
) -> int:
    """Write into `rows` which matches before `a` may be its neighbours, and return how many.

    Nine of ten fail by their distances alone, which takes a loop without branches; the trace of
    a slack bounds it along any direction. `places` holds x, y, z of target and source, (2, 3, m);
    `excess` is scratch.
    """
    for b in range(a):
        x, y, z = (
            places[0, 0, a] - places[0, 0, b],
            places[0, 1, a] - places[0, 1, b],
            places[0, 2, a] - places[0, 2, b],
        )
        u, v, w = (
            places[1, 0, a] - places[1, 0, b],
            places[1, 1, a] - places[1, 1, b],
            places[1, 2, a] - places[1, 2, b],
        )
        gap = math.sqrt(x * x + y * y + z * z) - math.sqrt(u * u + v * v + w * w)
        excess[b] = gap * gap - most * (room[a] + room[b])
    count = 0
    for b in range(a):
        rows[count] = b
        count += excess[b] <= 0.0
    return count


@kernel
def _level_misfit(
    target: Points,
    source: Points,
    target_slack: Matrix,
    source_slack: Matrix,
    turns: Matrix,
    tolerances: Vector,
    a: int,
    b: int,
) -> float:
    base, slope, angle, least = tolerances[0], tolerances[1], tolerances[2], tolerances[3]
    base *= base
    tx, ty = target[a, 0] - target[b, 0], target[a, 1] - target[b, 1]
    sx, sy = source[a, 0] - source[b, 0], source[a, 1] - source[b, 1]
    far_t, far_s = math.sqrt(tx * tx + ty * ty), math.sqrt(sx * sx + sy * sy)
    if far_t < least or far_s < least:
        return math.inf
    rise = target[a, 2] - target[b, 2] - source[a, 2] + source[b, 2]
    upward = target_slack[a, 5] + target_slack[b, 5] + source_slack[a, 5] + source_slack[b, 5]
    outlier_ratio = rise * rise / (base + slope * slope * far_t * far_t + upward)
    tx, ty, sx, sy = tx / far_t, ty / far_t, sx / far_s, sy / far_s
    along = _along(target_slack, a, b, tx, ty, 0.0) + _along(source_slack, a, b, sx, sy, 0.0)
    outlier_ratio += (far_t - far_s) ** 2 / (base + along)
    across = _along(target_slack, a, b, -ty, tx, 0.0) + _along(source_slack, a, b, -sy, sx, 0.0)
    spread = angle * angle + (base + across) / (far_t * far_s)
    # Twice the turn between the lines that join the centres: axes and lines have no sign.
    c, s = tx * sx + ty * sy, ty * sx - tx * sy
    c, s = c * c - s * s, 2.0 * c * s
    has_a = turns[a, 0] != 0.0 or turns[a, 1] != 0.0
    has_b = turns[b, 0] != 0.0 or turns[b, 1] != 0.0
    # The squared sine of an angle is half of 1 less the cosine of its double.
    if has_a:
        outlier_ratio += 0.5 * (1.0 - turns[a, 0] * c - turns[a, 1] * s) / spread
    if has_b:
        outlier_ratio += 0.5 * (1.0 - turns[b, 0] * c - turns[b, 1] * s) / spread
    if has_a and has_b:
        cosine = turns[a, 0] * turns[b, 0] + turns[a, 1] * turns[b, 1]
        outlier_ratio += 0.25 * (1.0 - cosine) / (angle * angle)
    return outlier_ratio


@kernel
def _free_misfit(
    target: Points,
    source: Points,
    target_slack: Matrix,
    source_slack: Matrix,
    target_axes: Points,
    source_axes: Points,
    tolerances: Vector,
    a: int,
    b: int,
) -> float:
    base, angle, least = tolerances[0], tolerances[2], tolerances[3]
    base *= base
    tx, ty, tz = (
        target[a, 0] - target[b, 0], target[a, 1] - target[b, 1], target[a, 2] - target[b, 2],
    )  # fmt: skip
    sx, sy, sz = (
        source[a, 0] - source[b, 0], source[a, 1] - source[b, 1], source[a, 2] - source[b, 2],
    )  # fmt: skip
    far_t, far_s = math.sqrt(tx * tx + ty * ty + tz * tz), math.sqrt(sx * sx + sy * sy + sz * sz)
    if far_t < least or far_s < least:
        return math.inf
    tx, ty, tz, sx, sy, sz = tx / far_t, ty / far_t, tz / far_t, sx / far_s, sy / far_s, sz / far_s
    along = _along(target_slack, a, b, tx, ty, tz) + _along(source_slack, a, b, sx, sy, sz)
    outlier_ratio = (far_t - far_s) ** 2 / (base + along)
    across = _trace(target_slack, a, b) + _trace(source_slack, a, b) - along
    # Two directions lie across the line, and one of them turns it towards the axis.
    spread = angle * angle + (base + 0.5 * across) / (far_t * far_s)
    ta, tb = _to_line(target_axes, a, tx, ty, tz), _to_line(target_axes, b, tx, ty, tz)
    sa, sb = _to_line(source_axes, a, sx, sy, sz), _to_line(source_axes, b, sx, sy, sz)
    t_axes = _to_line(target_axes, a, target_axes[b, 0], target_axes[b, 1], target_axes[b, 2])
    s_axes = _to_line(source_axes, a, source_axes[b, 0], source_axes[b, 1], source_axes[b, 2])
    outlier_ratio += ((ta - sa) ** 2 + (tb - sb) ** 2) / spread
    return outlier_ratio + 0.5 * (t_axes - s_axes) ** 2 / (angle * angle)


@kernel
def _along(slack: Matrix, a: int, b: int, x: float, y: float, z: float) -> float:
    """Return the slack of both parts together along a unit vector."""
    across = (slack[a, 1] + slack[b, 1]) * x * y
    across += (slack[a, 2] + slack[b, 2]) * x * z + (slack[a, 4] + slack[b, 4]) * y * z
    total = (slack[a, 0] + slack[b, 0]) * x * x + (slack[a, 3] + slack[b, 3]) * y * y
    return total + (slack[a, 5] + slack[b, 5]) * z * z + 2.0 * across


@kernel
def _trace(slack: Matrix, a: int, b: int) -> float:
    return slack[a, 0] + slack[b, 0] + slack[a, 3] + slack[b, 3] + slack[a, 5] + slack[b, 5]


@kernel
def _to_line(axes: Points, row: int, x: float, y: float, z: float) -> float:
    """Return the cosine of the angle between an axis and a line, neither of which has a sign."""
    return abs(axes[row, 0] * x + axes[row, 1] * y + axes[row, 2] * z)


@kernel
def _join(graph: Words, grades: Vector, outlier_ratio: float, a: int, b: int) -> None:
    for g in range(grades.shape[0] - 1, -1, -1):
        if outlier_ratio > grades[g]:
            break
        graph[g, a, b >> 6] |= np.uint64(1) << np.uint64(b & 63)
        graph[g, b, a >> 6] |= np.uint64(1) << np.uint64(a & 63)
