"""What the points of one scan look like around given places: counts, means and covariances.

The points are sorted by the cube that they lie in, once; a place then looks at the cubes that its
ball touches. Cubes find their points by a hash (Teschner et al. 2003); those that share a slot are
looked at once.
"""

import math

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Labels, Matrix, Points
from scanlock.kernels._compile import kernel

_BLOCK = 256
"""Points whose slots are computed at a time, for the sake of vector units."""

_POINTS_A_SLOT = 2
"""At most, on average: the table of a scan then stays in the cache."""

_SUMS = 10
"""The count, the three sums and the six products of the offsets from a place."""


@kernel
def _slot(i: int, j: int, k: int, last: int) -> int:
    """Return where the points of a cube are listed."""
    return ((i * 73856093) ^ (j * 19349663) ^ (k * 83492791)) & last


@kernel
def sorted_by_cube(points: Points, edge: float) -> tuple[Points, NDArray[np.int32]]:
    """Return (n, 3) points sorted by the slots of their cubes of side `edge`, and the first rows.

    Slot s holds the rows from ``starts[s]`` up to ``starts[s + 1]``, in the order they came in.
    """
    n = points.shape[0]
    slots = 1
    while _POINTS_A_SLOT * slots < n:
        slots *= 2
    per_metre = 1.0 / edge
    place = np.zeros((3, _BLOCK))
    slot_of = np.empty((n + _BLOCK - 1) // _BLOCK * _BLOCK, np.int32)
    starts = np.zeros(slots + 1, np.int32)
    for start in range(0, n, _BLOCK):
        count = min(_BLOCK, n - start)
        for p in range(count):
            place[0, p] = points[start + p, 0]
            place[1, p] = points[start + p, 1]
            place[2, p] = points[start + p, 2]
        for p in range(_BLOCK):
            i = int(np.floor(place[0, p] * per_metre))
            j = int(np.floor(place[1, p] * per_metre))
            k = int(np.floor(place[2, p] * per_metre))
            slot_of[start + p] = _slot(i, j, k, slots - 1)
        for p in range(start, start + count):
            starts[slot_of[p] + 1] += 1
    for slot in range(slots):
        starts[slot + 1] += starts[slot]
    following = starts.copy()
    ordered = np.empty((n, 3))
    for p in range(n):
        row = following[slot_of[p]]
        following[slot_of[p]] += 1
        ordered[row, 0], ordered[row, 1], ordered[row, 2] = points[p, 0], points[p, 1], points[p, 2]
    return ordered, starts


@kernel
def _slots_near(
    x: float, y: float, z: float, radius: float, per_metre: float,
    starts: NDArray[np.int32], visited: Labels,
) -> int:  # fmt: skip
    """List the slots of the cubes that a ball touches, each once; return how many have points.

    Cubes may share a slot, whose points would be counted again.
    """
    last, count = starts.shape[0] - 2, 0
    low_i, high_i = math.floor((x - radius) * per_metre), math.floor((x + radius) * per_metre)
    low_j, high_j = math.floor((y - radius) * per_metre), math.floor((y + radius) * per_metre)
    low_k, high_k = math.floor((z - radius) * per_metre), math.floor((z + radius) * per_metre)
    for i in range(low_i, high_i + 1):
        for j in range(low_j, high_j + 1):
            for k in range(low_k, high_k + 1):
                slot = _slot(i, j, k, last)
                if starts[slot] == starts[slot + 1]:
                    continue
                is_new = True
                for one in range(count):
                    is_new = is_new and visited[one] != slot
                if is_new:
                    visited[count] = slot
                    count += 1
    return count


@kernel
def sums_near(
    ordered: Points, starts: NDArray[np.int32], edge: float, probes: Points, radius: float
) -> Matrix:
    """Return (m, 10) sums over the points nearer than `radius` to each of (m, 3) probes.

    Of the offsets d from the probe: how many, ``d`` (3), and the upper triangle of ``d d'`` (6) in
    the order xx, xy, xz, yy, yz, zz. The points are those of `sorted_by_cube`.
    """
    per_metre = 1.0 / edge
    sums = np.zeros((probes.shape[0], _SUMS))
    across = min(1e6, 2.0 * radius * per_metre + 2.0)
    visited = np.empty(np.int64(min(across * across * across, 1.0 * starts.shape[0])), np.int64)
    for probe in range(probes.shape[0]):
        x, y, z = probes[probe, 0], probes[probe, 1], probes[probe, 2]
        visits = _slots_near(x, y, z, radius, per_metre, starts, visited)
        count = 0
        s0 = s1 = s2 = s3 = s4 = s5 = s6 = s7 = s8 = 0.0
        for visit in range(visits):
            slot = visited[visit]
            for p in range(starts[slot], starts[slot + 1]):
                u, v, w = ordered[p, 0] - x, ordered[p, 1] - y, ordered[p, 2] - z
                if u * u + v * v + w * w >= radius * radius:
                    continue
                count += 1
                s0 += u
                s1 += v
                s2 += w
                s3 += u * u
                s4 += u * v
                s5 += u * w
                s6 += v * v
                s7 += v * w
                s8 += w * w
        row = sums[probe]
        row[0], row[1], row[2], row[3] = count, s0, s1, s2
        row[4], row[5], row[6], row[7], row[8], row[9] = s3, s4, s5, s6, s7, s8
    return sums
