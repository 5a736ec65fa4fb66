"""Moments of the points in each voxel of a grid, for voxel indices below a million.

The three indices of such a voxel fit into one integer, its key. Keys are compared and hashed at
once, and sort as the indices do.
"""

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector
from scanlock.kernels._compile import helper, kernel

_HALF = 1 << 20
"""Bound of the magnitude of an index."""

_BITS = 21
"""Bits of an index in a key."""

_LOW_BITS = (1 << _BITS) - 1
"""Mask of the last index of a key."""

_BLOCK = 256
"""Points whose keys are computed together, in loops that use vector units."""

_MIN_CAPACITY = 1024
"""Smallest initial capacity, in voxels."""

_POINTS_PER_VOXEL = 16
"""Points of the scan per voxel of the initial capacity; scans rarely have more voxels."""

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
"""Multiplier that carries every bit of a key to the highest bits (Knuth 1973)."""

_HASH_SHIFT = np.uint64(36)
"""Drops the lower bits of a product, which are hashed less well; 28 remain for the slot."""


@helper
def _index(key: int, axis: int) -> int:
    """Return one of the three indices of a key."""
    return ((key >> (_BITS * (2 - axis))) & _LOW_BITS) - _HALF


@helper
def _find(table: Labels, key: int) -> int:
    """Return the slot of a key: the one that holds it, or the empty one that it belongs in."""
    last = table.shape[0] - 1
    slot = np.int64((np.uint64(key) * _GOLDEN) >> _HASH_SHIFT) & last
    while table[slot] != key and table[slot] >= 0:
        slot = (slot + 1) & last
    return slot


@helper
def _table_of(keys: Labels, count: int) -> tuple[Labels, Labels]:
    """Return a hash table of `count` keys, as keys and rows, with room for the whole array."""
    table = np.full(4 * keys.shape[0], -1, np.int64)
    rows = np.empty(4 * keys.shape[0], np.int64)
    for row in range(count):
        slot = _find(table, keys[row])
        table[slot] = keys[row]
        rows[slot] = row
    return table, rows


@helper
def _fill_block(
    points: Points, start: int, corner: Vector, voxel_size: float, offsets: Matrix, keys: Labels
) -> int:
    """Write the keys of a block of points, and the offsets from the centres of their voxels.

    The key of point p is written at p + 1. Return 0 if all indices are in range.
    """
    for p in range(min(_BLOCK, points.shape[0] - start)):
        offsets[0, p] = points[start + p, 0]
        offsets[1, p] = points[start + p, 1]
        offsets[2, p] = points[start + p, 2]
    corner0, corner1, corner2 = corner[0], corner[1], corner[2]
    is_far = 0
    for p in range(_BLOCK):
        i = np.floor((offsets[0, p] - corner0) / voxel_size)
        j = np.floor((offsets[1, p] - corner1) / voxel_size)
        k = np.floor((offsets[2, p] - corner2) / voxel_size)
        offsets[0, p] -= corner0 + (i + 0.5) * voxel_size
        offsets[1, p] -= corner1 + (j + 0.5) * voxel_size
        offsets[2, p] -= corner2 + (k + 0.5) * voxel_size
        is_far |= int(abs(i) >= _HALF) | int(abs(j) >= _HALF) | int(abs(k) >= _HALF)
        key = (np.int64(i) + _HALF) << (2 * _BITS)
        keys[p + 1] = key | ((np.int64(j) + _HALF) << _BITS) | (np.int64(k) + _HALF)
    return is_far


@helper
def _find_runs(keys: Labels, count: int, starts: Labels) -> int:
    """Write where runs of equal keys begin, and where the last ends; return their number.

    Always written, kept only where a run begins: no branch to predict.
    """
    runs = 0
    for p in range(count):
        starts[runs] = p
        runs += np.int64(keys[p + 1] != keys[p])
    starts[runs] = count
    return int(runs)


@helper
def _add_points(
    points: Points, begin: int, corner: Vector, voxel_size: float,
    keys: Labels, sums: Matrix, table: Labels, rows: Labels, count: int,
) -> tuple[int, int]:  # fmt: skip
    """Add points from row `begin` on until the next block may have more voxels than there is room.

    Return the next row, -1 if a point is out of range, and the number of voxels.
    """
    n = points.shape[0]
    offsets = np.zeros((3, _BLOCK), np.float64)
    starts = np.empty(_BLOCK + 1, np.int64)
    own_keys = np.empty(_BLOCK + 1, np.int64)
    # Not a key, so the first point always begins a run.
    own_keys[0] = -1
    for start in range(begin, n, _BLOCK):
        size = min(_BLOCK, n - start)
        if count + size > keys.shape[0]:
            return start, count
        if _fill_block(points, start, corner, voxel_size, offsets, own_keys) != 0:
            return -1, count
        for run in range(_find_runs(own_keys, size, starts)):
            first = starts[run]
            key = int(own_keys[first + 1])
            slot = _find(table, key)
            if table[slot] < 0:
                table[slot], rows[slot], keys[count] = key, count, key
                for entry in range(10):
                    sums[count, entry] = 0.0
                count += 1
            row, end = rows[slot], starts[run + 1]
            sx = sy = sz = sxx = sxy = sxz = syy = syz = szz = 0.0
            # Unsigned, because Numba checks the sign of other indices.
            for p in range(np.uint64(first), np.uint64(end)):
                x, y, z = offsets[0, p], offsets[1, p], offsets[2, p]
                sx += x
                sy += y
                sz += z
                sxx += x * x
                sxy += x * y
                sxz += x * z
                syy += y * y
                syz += y * z
                szz += z * z
            sums[row, 0] += end - first
            sums[row, 1] += sx
            sums[row, 2] += sy
            sums[row, 3] += sz
            sums[row, 4] += sxx
            sums[row, 5] += sxy
            sums[row, 6] += sxz
            sums[row, 7] += syy
            sums[row, 8] += syz
            sums[row, 9] += szz
    return n, count


@kernel
def voxel_sums(
    points: Points, corner: Vector, voxel_size: float, min_count: int
) -> tuple[bool, Labels, Matrix]:
    """Return the voxels with at least `min_count` points, and sums over the points of each.

    Offsets are relative to the centres of the voxels, which loses no digits far from the origin.

    Parameters
    ----------
    points : (n, 3) [m]
    corner : (3,) [m]
        Corner of voxel (0, 0, 0).
    voxel_size : float [m]
    min_count : int

    Returns
    -------
    fits : bool
        Whether all indices are in range; otherwise there are no voxels.
    keys : (m,)
        In the order of first points.
    sums : (m, 10)
        Of 1, x, y, z, xx, xy, xz, yy, yz, zz, with the offsets x, y, z [m] from the centre.
    """
    n = points.shape[0]
    capacity = _MIN_CAPACITY
    while _POINTS_PER_VOXEL * capacity < n:
        capacity *= 2
    keys, sums = np.empty(capacity, np.int64), np.empty((capacity, 10), np.float64)
    table, rows = _table_of(keys, 0)
    done, count = _add_points(points, 0, corner, voxel_size, keys, sums, table, rows, 0)
    while 0 <= done < n:
        keys = np.concatenate((keys, np.empty_like(keys)))
        sums = np.concatenate((sums, np.empty_like(sums)))
        table, rows = _table_of(keys, count)
        done, count = _add_points(points, done, corner, voxel_size, keys, sums, table, rows, count)
    full = 0
    for row in range(count if done >= 0 else 0):
        if sums[row, 0] >= min_count:
            keys[full] = keys[row]
            for entry in range(10):
                sums[full, entry] = sums[row, entry]
            full += 1
    return done >= 0, keys[:full].copy(), sums[:full].copy()


@kernel
def moments_from_sums(
    order: Labels, keys: Labels, sums: Matrix, corner: Vector, voxel_size: float
) -> tuple[Labels, Labels, Points, Matrix]:
    """Return the moments of the sums of `voxel_sums`, in another order.

    Returns
    -------
    voxels : (m, 3)
        Indices.
    counts : (m,)
    means : (m, 3) [m]
    packed : (m, 6) [m^2]
        Upper triangles of the covariances, divided by the counts.
    """
    m = order.shape[0]
    voxels, counts = np.empty((m, 3), np.int64), np.empty(m, np.int64)
    means, packed = np.empty((m, 3), np.float64), np.empty((m, 6), np.float64)
    for t in range(m):
        row = order[t]
        scale = 1.0 / sums[row, 0]
        x, y, z = scale * sums[row, 1], scale * sums[row, 2], scale * sums[row, 3]
        counts[t] = np.int64(sums[row, 0])
        for axis in range(3):
            index = _index(int(keys[row]), axis)
            voxels[t, axis] = index
            means[t, axis] = scale * sums[row, 1 + axis] + (
                corner[axis] + (index + 0.5) * voxel_size
            )
        packed[t, 0] = scale * sums[row, 4] - x * x
        packed[t, 1] = scale * sums[row, 5] - x * y
        packed[t, 2] = scale * sums[row, 6] - x * z
        packed[t, 3] = scale * sums[row, 7] - y * y
        packed[t, 4] = scale * sums[row, 8] - y * z
        packed[t, 5] = scale * sums[row, 9] - z * z
    return voxels, counts, means, packed
