"""Sums over the points of a scan within a radius of query points: counts, means, covariances.

The points are sorted by voxel once (a cell list); a query visits the voxels that its ball touches.
Voxels find their points by a hash; voxels that share a slot are visited once.
"""

import math

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Labels, Matrix, Points
from scanlock.kernels._compile import helper, kernel
from scanlock.kernels._inline import voxel_slot

_BLOCK = 256
"""Points whose slots are computed together, in loops that use vector units."""

_POINTS_PER_SLOT = 2
"""Largest mean number of points in a slot: the table of a scan then stays in the cache."""

_SUMS = 10
"""Count, three sums and six products of the offsets from a query point."""


@kernel
def sorted_by_voxel(points: Points, voxel_size: float) -> tuple[Points, NDArray[np.int32]]:
    """Return (n, 3) points [m] sorted by the hash slots of their voxels, and the slots' first rows.

    Slot s has the rows ``starts[s] : starts[s + 1]``, in their original order.
    """
    n = points.shape[0]
    slots = 1
    while _POINTS_PER_SLOT * slots < n:
        slots *= 2
    per_metre = 1.0 / voxel_size
    block = np.zeros((3, _BLOCK))
    slot_of = np.empty((n + _BLOCK - 1) // _BLOCK * _BLOCK, np.int32)
    starts = np.zeros(slots + 1, np.int32)
    for start in range(0, n, _BLOCK):
        count = min(_BLOCK, n - start)
        for p in range(count):
            block[0, p] = points[start + p, 0]
            block[1, p] = points[start + p, 1]
            block[2, p] = points[start + p, 2]
        for p in range(_BLOCK):
            i = int(np.floor(block[0, p] * per_metre))
            j = int(np.floor(block[1, p] * per_metre))
            k = int(np.floor(block[2, p] * per_metre))
            slot_of[start + p] = voxel_slot(i, j, k, slots - 1)
        for p in range(start, start + count):
            starts[slot_of[p] + 1] += 1
    for slot in range(slots):
        starts[slot + 1] += starts[slot]
    cursor = starts.copy()
    ordered = np.empty((n, 3))
    for p in range(n):
        row = cursor[slot_of[p]]
        cursor[slot_of[p]] += 1
        ordered[row, 0], ordered[row, 1], ordered[row, 2] = points[p, 0], points[p, 1], points[p, 2]
    return ordered, starts


@helper
def _slots_of_ball(
    x: float, y: float, z: float, radius: float, per_metre: float,
    starts: NDArray[np.int32], slots: Labels,
) -> int:  # fmt: skip
    """Write the non-empty slots of the voxels that a ball touches, each once; return their number.

    Voxels may share a slot, whose points must not be counted twice.
    """
    last, count = starts.shape[0] - 2, 0
    low_i, high_i = math.floor((x - radius) * per_metre), math.floor((x + radius) * per_metre)
    low_j, high_j = math.floor((y - radius) * per_metre), math.floor((y + radius) * per_metre)
    low_k, high_k = math.floor((z - radius) * per_metre), math.floor((z + radius) * per_metre)
    for i in range(low_i, high_i + 1):
        for j in range(low_j, high_j + 1):
            for k in range(low_k, high_k + 1):
                slot = voxel_slot(i, j, k, last)
                if starts[slot] == starts[slot + 1]:
                    continue
                is_new = True
                for s in range(count):
                    is_new = is_new and slots[s] != slot
                if is_new:
                    slots[count] = slot
                    count += 1
    return count


@kernel
def sums_within_radius(
    ordered: Points,
    starts: NDArray[np.int32],
    voxel_size: float,
    query_points: Points,
    radius: float,
) -> Matrix:
    """Return (m, 10) sums over the points nearer than `radius` [m] to each of (m, 3) query points.

    The sums of the offsets d from the query point are their number, ``d`` (3) [m], and the upper
    triangle of ``d d'`` (6) [m^2] in the order xx, xy, xz, yy, yz, zz. `ordered`, `starts` and
    `voxel_size` are those of `sorted_by_voxel`.
    """
    per_metre = 1.0 / voxel_size
    sums = np.zeros((query_points.shape[0], _SUMS))
    across = min(1e6, 2.0 * radius * per_metre + 2.0)
    slots = np.empty(np.int64(min(across * across * across, 1.0 * starts.shape[0])), np.int64)
    for q in range(query_points.shape[0]):
        x, y, z = query_points[q, 0], query_points[q, 1], query_points[q, 2]
        slot_count = _slots_of_ball(x, y, z, radius, per_metre, starts, slots)
        count = 0
        s0 = s1 = s2 = s3 = s4 = s5 = s6 = s7 = s8 = 0.0
        for s in range(slot_count):
            slot = slots[s]
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
        row = sums[q]
        row[0], row[1], row[2], row[3] = count, s0, s1, s2
        row[4], row[5], row[6], row[7], row[8], row[9] = s3, s4, s5, s6, s7, s8
    return sums
