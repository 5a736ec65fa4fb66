"""Moments of the points in each cube of a grid, for cubes that lie within a million of zero.

The three indices of such a cube fit into one number, its key: keys are compared and hashed at
once, and ascend as the indices do.
"""

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector
from scanlock.kernels._compile import kernel

_HALF = 1 << 20
"""Indices are smaller than this either way."""

_BITS = 21
"""What an index takes of a key."""

_LOW_BITS = (1 << _BITS) - 1
"""The last index of a key."""

_BLOCK = 256
"""Points whose keys are computed at a time, for the sake of vector units."""

_FIRST_ROOM = 1024
"""Cubes there is room for at first."""

_SHARE = 16
"""There is room for a cube to so many points at first: scans take rarely more."""

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
"""Multiplying by this carries every bit of a key to the highest (Knuth 1973)."""

_HASH_SHIFT = np.uint64(36)
"""The higher a bit, the better; what is left is enough for tables of 2^28 slots."""


@kernel
def _index(key: int, axis: int) -> int:
    """Return one of the three indices of a key."""
    return ((key >> (_BITS * (2 - axis))) & _LOW_BITS) - _HALF


@kernel
def _find(table: Labels, key: int) -> int:
    """Return the slot of a key: where it is, or the empty one where it belongs."""
    last = table.shape[0] - 1
    slot = np.int64((np.uint64(key) * _GOLDEN) >> _HASH_SHIFT) & last
    while table[slot] != key and table[slot] >= 0:
        slot = (slot + 1) & last
    return slot


@kernel
def _table_of(keys: Labels, count: int) -> tuple[Labels, Labels]:
    """Return the hash of `count` keys with room for all of the array: keys, and their rows."""
    table = np.full(4 * keys.shape[0], -1, np.int64)
    rows = np.empty(4 * keys.shape[0], np.int64)
    for row in range(count):
        slot = _find(table, keys[row])
        table[slot] = keys[row]
        rows[slot] = row
    return table, rows


@kernel
def _place(
    points: Points, start: int, corner: Vector, width: float, place: Matrix, keys: Labels
) -> int:
    """Write the keys of the points from `start` on, and where they lie from their cubes' middles.

    The key of point p comes at p + 1. Return 0 if all indices are in range.
    """
    for p in range(min(_BLOCK, points.shape[0] - start)):
        place[0, p] = points[start + p, 0]
        place[1, p] = points[start + p, 1]
        place[2, p] = points[start + p, 2]
    corner0, corner1, corner2 = corner[0], corner[1], corner[2]
    is_far = 0
    for p in range(_BLOCK):
        i = np.floor((place[0, p] - corner0) / width)
        j = np.floor((place[1, p] - corner1) / width)
        k = np.floor((place[2, p] - corner2) / width)
        place[0, p] -= corner0 + (i + 0.5) * width
        place[1, p] -= corner1 + (j + 0.5) * width
        place[2, p] -= corner2 + (k + 0.5) * width
        is_far |= int(abs(i) >= _HALF) | int(abs(j) >= _HALF) | int(abs(k) >= _HALF)
        key = (np.int64(i) + _HALF) << (2 * _BITS)
        keys[p + 1] = key | ((np.int64(j) + _HALF) << _BITS) | (np.int64(k) + _HALF)
    return is_far


@kernel
def _find_runs(keys: Labels, count: int, starts: Labels) -> int:
    """Write where runs of equal keys begin, and where the last ends; return how many there are.

    Written every time and kept only where a run begins: no branch to guess.
    """
    runs = 0
    for p in range(count):
        starts[runs] = p
        runs += np.int64(keys[p + 1] != keys[p])
    starts[runs] = count
    return int(runs)


@kernel
def _add_points(
    points: Points, begin: int, corner: Vector, width: float,
    keys: Labels, sums: Matrix, table: Labels, rows: Labels, count: int,
) -> tuple[int, int]:  # fmt: skip
    """Add points from row `begin` on until there may be no room for the cubes of a block.

    Return the row that comes next, -1 if a point is out of range, and how many cubes there are.
    """
    n = points.shape[0]
    place = np.zeros((3, _BLOCK), np.float64)
    starts = np.empty(_BLOCK + 1, np.int64)
    of_points = np.empty(_BLOCK + 1, np.int64)
    # No key: the first point always begins a run.
    of_points[0] = -1
    for start in range(begin, n, _BLOCK):
        size = min(_BLOCK, n - start)
        if count + size > keys.shape[0]:
            return start, count
        if _place(points, start, corner, width, place, of_points) != 0:
            return -1, count
        for run in range(_find_runs(of_points, size, starts)):
            first = starts[run]
            key = int(of_points[first + 1])
            slot = _find(table, key)
            if table[slot] < 0:
                table[slot], rows[slot], keys[count] = key, count, key
                for entry in range(10):
                    sums[count, entry] = 0.0
                count += 1
            row, past = rows[slot], starts[run + 1]
            sx = sy = sz = sxx = sxy = sxz = syy = syz = szz = 0.0
            # Unsigned, so nothing need be asked about places counted from the end.
            for p in range(np.uint64(first), np.uint64(past)):
                x, y, z = place[0, p], place[1, p], place[2, p]
                sx += x
                sy += y
                sz += z
                sxx += x * x
                sxy += x * y
                sxz += x * z
                syy += y * y
                syz += y * z
                szz += z * z
            sums[row, 0] += past - first
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
    points: Points, corner: Vector, width: float, least_count: int
) -> tuple[bool, Labels, Matrix]:
    """Return the cubes with at least `least_count` points, and sums over the points of each.

    Sums are taken about the middles of the cubes, so no digits are lost far from zero.

    Returns
    -------
    fits : bool
        Whether all indices are in range; else there are no cubes.
    keys : (m,)
        In the order of first points.
    sums : (m, 10)
        Of 1, x, y, z, xx, xy, xz, yy, yz, zz; x, y, z from the middle [m].
    """
    n = points.shape[0]
    room = _FIRST_ROOM
    while _SHARE * room < n:
        room *= 2
    keys, sums = np.empty(room, np.int64), np.empty((room, 10), np.float64)
    table, rows = _table_of(keys, 0)
    done, count = _add_points(points, 0, corner, width, keys, sums, table, rows, 0)
    while 0 <= done < n:
        keys = np.concatenate((keys, np.empty_like(keys)))
        sums = np.concatenate((sums, np.empty_like(sums)))
        table, rows = _table_of(keys, count)
        done, count = _add_points(points, done, corner, width, keys, sums, table, rows, count)
    full = 0
    for row in range(count if done >= 0 else 0):
        if sums[row, 0] >= least_count:
            keys[full] = keys[row]
            for entry in range(10):
                sums[full, entry] = sums[row, entry]
            full += 1
    return done >= 0, keys[:full].copy(), sums[:full].copy()


@kernel
def moments_of_sums(
    order: Labels, keys: Labels, sums: Matrix, corner: Vector, width: float
) -> tuple[Labels, Labels, Points, Matrix]:
    """Return what `voxel_sums` found in another order, as moments.

    Returns
    -------
    cells : (m, 3)
        Indices of the cubes.
    counts : (m,)
    means : (m, 3) [m]
    packed : (m, 6) [m^2]
        Upper triangles of the covariances, divided by the counts.
    """
    m = order.shape[0]
    cells, counts = np.empty((m, 3), np.int64), np.empty(m, np.int64)
    means, packed = np.empty((m, 3), np.float64), np.empty((m, 6), np.float64)
    for t in range(m):
        row = order[t]
        share = 1.0 / sums[row, 0]
        x, y, z = share * sums[row, 1], share * sums[row, 2], share * sums[row, 3]
        counts[t] = np.int64(sums[row, 0])
        for axis in range(3):
            index = _index(int(keys[row]), axis)
            cells[t, axis] = index
            means[t, axis] = share * sums[row, 1 + axis] + (corner[axis] + (index + 0.5) * width)
        packed[t, 0] = share * sums[row, 4] - x * x
        packed[t, 1] = share * sums[row, 5] - x * y
        packed[t, 2] = share * sums[row, 6] - x * z
        packed[t, 3] = share * sums[row, 7] - y * y
        packed[t, 4] = share * sums[row, 8] - y * z
        packed[t, 5] = share * sums[row, 9] - z * z
    return cells, counts, means, packed
