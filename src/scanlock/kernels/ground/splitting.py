"""Recursive splitting of clusters along their longest axis, and the moments of the parts."""

import math

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Labels, Matrix, Points, Vector
from scanlock.kernels._compile import helper, kernel, sum_helper

_PLANE_TOLERANCE = 1e-9
"""Distance within which a point counts as on the splitting plane, in deviations of the part."""

_Flags = NDArray[np.uint8]
"""Whether each point is on the near side, as numbers, which vector units can write."""


@sum_helper
def _fill_moments(x: Vector, y: Vector, z: Vector, radius: float, moments: Vector) -> bool:
    """Write the mean (3) and the packed covariance (6) of points, in two passes for accuracy.

    Return whether any point is farther than `radius` from the mean.
    """
    n = x.shape[0]
    mx = my = mz = 0.0
    for i in range(n):
        mx += x[i]
        my += y[i]
        mz += z[i]
    mx /= n
    my /= n
    mz /= n
    xx = xy = xz = yy = yz = zz = 0.0
    beyond = 0.0
    for i in range(n):
        dx = x[i] - mx
        dy = y[i] - my
        dz = z[i] - mz
        xx += dx * dx
        xy += dx * dy
        xz += dx * dz
        yy += dy * dy
        yz += dy * dz
        zz += dz * dz
        # Counting uses vector units; a maximum would not.
        beyond += 1.0 if dx * dx + dy * dy + dz * dz > radius * radius else 0.0
    moments[0], moments[1], moments[2] = mx, my, mz
    moments[3], moments[4], moments[5] = xx / n, xy / n, xz / n
    moments[6], moments[7], moments[8] = yy / n, yz / n, zz / n
    return beyond > 0.0


@sum_helper
def _reaches_beyond(x: Vector, y: Vector, z: Vector, radius: float, moments: Vector) -> bool:
    """Return whether any point is farther than `radius` from the mean in `moments`."""
    mx, my, mz = moments[0], moments[1], moments[2]
    beyond = 0.0
    for i in range(x.shape[0]):
        dx = x[i] - mx
        dy = y[i] - my
        dz = z[i] - mz
        beyond += 1.0 if dx * dx + dy * dy + dz * dz > radius * radius else 0.0
    return beyond > 0.0


@helper
def _longest_axis(moments: Vector) -> tuple[float, float, float]:
    """Return the unit vector of the largest variance; zero if there is no variance."""
    xx, xy, xz = moments[3], moments[4], moments[5]
    yy, yz, zz = moments[6], moments[7], moments[8]
    trace = xx + yy + zz
    if trace == 0.0:
        return 0.0, 0.0, 0.0
    xx, xy, xz, yy, yz, zz = xx / trace, xy / trace, xz / trace, yy / trace, yz / trace, zz / trace
    # Squaring the matrix six times is 64 power iterations; its columns then all point along the
    # longest axis, most accurately the one with the largest diagonal, which is at least 3**-64.
    for _ in range(6):
        xx, xy, xz, yy, yz, zz = (
            xx * xx + xy * xy + xz * xz,
            xx * xy + xy * yy + xz * yz,
            xx * xz + xy * yz + xz * zz,
            xy * xy + yy * yy + yz * yz,
            xy * xz + yy * yz + yz * zz,
            xz * xz + yz * yz + zz * zz,
        )
    if xx >= yy and xx >= zz:
        a, b, c = xx, xy, xz
    elif yy >= zz:
        a, b, c = xy, yy, yz
    else:
        a, b, c = xz, yz, zz
    norm = math.sqrt(a * a + b * b + c * c)
    return a / norm, b / norm, c / norm


@helper
def _mark_near(x: Vector, y: Vector, z: Vector, moments: Vector, is_near: _Flags) -> None:
    """Mark the points on the near side of the plane through the mean across the longest axis."""
    a, b, c = _longest_axis(moments)
    mx, my, mz = moments[0], moments[1], moments[2]
    limit = -_PLANE_TOLERANCE * math.sqrt(moments[3] + moments[6] + moments[8])
    for i in range(x.shape[0]):
        is_near[i] = np.uint8(a * (x[i] - mx) + b * (y[i] - my) + c * (z[i] - mz) < limit)


@helper
def _partition_points(
    x: Vector, y: Vector, z: Vector, is_near: _Flags, to_x: Vector, to_y: Vector, to_z: Vector
) -> int:
    """Copy points, the near ones to the front and the others to the back; count the near ones."""
    front, back = np.uint64(0), np.uint64(x.shape[0] - 1)
    # Each point is written to both ends, and only one of them advances: no branch to predict.
    for i in range(x.shape[0]):
        px, py, pz, near = x[i], y[i], z[i], np.uint64(is_near[i])
        to_x[front], to_y[front], to_z[front] = px, py, pz
        to_x[back], to_y[back], to_z[back] = px, py, pz
        front += near
        back -= np.uint64(1) - near
    return int(front)


@helper
def _partition_rows(rows: Vector, is_near: _Flags, to_rows: Vector) -> None:
    """Copy the rows of points as `_partition_points` copies the points."""
    front, back = np.uint64(0), np.uint64(rows.shape[0] - 1)
    for i in range(rows.shape[0]):
        row, near = rows[i], np.uint64(is_near[i])
        to_rows[front] = row
        to_rows[back] = row
        front += near
        back -= np.uint64(1) - near


@helper
def _split(
    tables: NDArray[np.float64], source: int, begin: int, end: int, moments: Vector, is_near: _Flags
) -> int:
    """Copy a run to the other table, near points first; return where the others begin."""
    target = 1 - source
    # Row by row, because only then the compiler sees that they are contiguous.
    x, y, z = (
        tables[source, 0, begin:end],
        tables[source, 1, begin:end],
        tables[source, 2, begin:end],
    )
    u, v, w = (
        tables[target, 0, begin:end],
        tables[target, 1, begin:end],
        tables[target, 2, begin:end],
    )
    _mark_near(x, y, z, moments, is_near)
    near = _partition_points(x, y, z, is_near, u, v, w)
    if tables.shape[1] == 4:
        _partition_rows(tables[source, 3, begin:end], is_near, tables[target, 3, begin:end])
    return begin + near


@helper
def _sorted_by_label(
    points: Points, labels: Labels, parts: int, keeps_rows: bool
) -> tuple[Labels, NDArray[np.float64]]:
    """Return where each part begins, and two tables (2, 3 or 4, n) of coordinates sorted by part.

    A fourth row of the first table holds the rows of `points`. The second table is empty.
    """
    # Labels of -1 count in the first entry, which no part uses.
    starts = np.zeros(parts + 2, np.int64)
    for i in range(points.shape[0]):
        starts[np.uint64(labels[i] + 2)] += 1
    starts[0] = starts[1] = 0
    for k in range(parts):
        starts[k + 2] += starts[k + 1]
    tables = np.empty((2, 4 if keeps_rows else 3, starts[parts + 1]), np.float64)
    x, y, z = tables[0, 0], tables[0, 1], tables[0, 2]
    cursor = starts[1:].copy()
    for i in range(points.shape[0]):
        if labels[i] >= 0:
            at = cursor[labels[i]]
            cursor[labels[i]] += 1
            x[at], y[at], z[at] = points[i, 0], points[i, 1], points[i, 2]
            if keeps_rows:
                tables[0, 3, at] = i
    return starts[1:], tables


@kernel
def split_by_extent(
    points: Points, labels: Labels, parts: int, radii: Vector, keeps_rows: bool
) -> tuple[Labels, Labels, Matrix]:
    """Split parts until no point is farther than a radius from the mean of its part.

    A larger part is split in two by the plane through its mean across its longest axis,
    recursively. Each split depends only on the set of points, so neither their order nor the
    numbering of the parts changes which points stay together; points on the plane, to rounding,
    go to the far side. Splitting to a smaller radius continues from the larger one.

    Parameters
    ----------
    points : (n, 3) [m]
    labels : (n,)
        -1 for no part.
    parts : int
    radii : (r,) [m]
        Descending.
    keeps_rows : bool
        Whether to return `rows`, which takes time.

    Returns
    -------
    rows : (m,)
        Rows of all labelled points, in an order in which every part is a run; empty unless
        `keeps_rows`.
    runs : (k, 3)
        Index of a radius, and where a part for this radius begins and ends in `rows`.
    moments : (k, 9)
        Mean (3) [m] and packed covariance (6) [m^2] of each run, divided by the count.
    """
    # A split copies a run from one of the two tables to the other.
    starts, tables = _sorted_by_label(points, labels, parts, keeps_rows)
    n = tables.shape[2]
    rows = np.empty(n if keeps_rows else 0, np.int64)
    runs = np.empty((max(16, 4 * parts), 3), np.int64)
    moments = np.empty((runs.shape[0], 9), np.float64)
    own = np.empty(9, np.float64)
    is_near = np.empty(n, np.uint8)
    # Stack of runs to be split or kept: index of the next radius, begin, end, and table. A run of
    # one point is never split.
    stack = np.empty((n + 1, 4), np.int64)
    found = 0
    for k in range(parts):
        stack[0, 0], stack[0, 1], stack[0, 2], stack[0, 3] = 0, starts[k], starts[k + 1], 0
        depth = 1 if starts[k] < starts[k + 1] else 0
        while depth > 0:
            depth -= 1
            scale, begin, end, table = stack[depth]
            x, y, z = (
                tables[table, 0, begin:end],
                tables[table, 1, begin:end],
                tables[table, 2, begin:end],
            )
            is_long = _fill_moments(x, y, z, float(radii[scale]), own)
            while scale < radii.shape[0]:
                if is_long:
                    middle = _split(tables, table, begin, end, own, is_near)
                    if begin < middle < end:
                        for first, last in ((begin, middle), (middle, end)):
                            stack[depth, 0], stack[depth, 1] = scale, first
                            stack[depth, 2], stack[depth, 3] = last, 1 - table
                            depth += 1
                        break
                if found == runs.shape[0]:
                    runs = np.concatenate((runs, np.empty_like(runs)))
                    moments = np.concatenate((moments, np.empty_like(moments)))
                runs[found, 0], runs[found, 1], runs[found, 2] = scale, begin, end
                for entry in range(own.shape[0]):
                    moments[found, entry] = own[entry]
                found += 1
                scale += 1
                if scale < radii.shape[0]:
                    is_long = _reaches_beyond(x, y, z, float(radii[scale]), own)
                elif keeps_rows:
                    for p in range(begin, end):
                        rows[p] = np.int64(tables[table, 3, p])
    return rows, runs[:found].copy(), moments[:found].copy()
