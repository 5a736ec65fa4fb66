"""Parts that are too long, cut in two again and again, and the moments of what is left."""

import math

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Labels, Matrix, Points, Vector
from scanlock.kernels._compile import kernel, sum_kernel

_ON_THE_PLANE = 1e-9
"""Share of a part's deviation within which a point counts as on the cutting plane."""

_Flags = NDArray[np.uint8]
"""Whether each point is near, as numbers: vector units write these."""


@sum_kernel
def _fill_moments(x: Vector, y: Vector, z: Vector, radius: float, moments: Vector) -> bool:
    """Write the mean (3) and the packed covariance (6) of points; in two passes, as digits go.

    Tells whether any point is farther than `radius` from the mean.
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
        # Counting uses vector units; the largest distance would not.
        beyond += 1.0 if dx * dx + dy * dy + dz * dz > radius * radius else 0.0
    moments[0], moments[1], moments[2] = mx, my, mz
    moments[3], moments[4], moments[5] = xx / n, xy / n, xz / n
    moments[6], moments[7], moments[8] = yy / n, yz / n, zz / n
    return beyond > 0.0


@sum_kernel
def _reaches_beyond(x: Vector, y: Vector, z: Vector, radius: float, moments: Vector) -> bool:
    """Tell whether any point is farther than `radius` from the mean of known moments."""
    mx, my, mz = moments[0], moments[1], moments[2]
    beyond = 0.0
    for i in range(x.shape[0]):
        dx = x[i] - mx
        dy = y[i] - my
        dz = z[i] - mz
        beyond += 1.0 if dx * dx + dy * dy + dz * dz > radius * radius else 0.0
    return beyond > 0.0


@kernel
def _longest_axis(moments: Vector) -> tuple[float, float, float]:
    """Return the unit vector of the largest variance; zero where there is no variance."""
    xx, xy, xz = moments[3], moments[4], moments[5]
    yy, yz, zz = moments[6], moments[7], moments[8]
    trace = xx + yy + zz
    if trace == 0.0:
        return 0.0, 0.0, 0.0
    xx, xy, xz, yy, yz, zz = xx / trace, xy / trace, xz / trace, yy / trace, yz / trace, zz / trace
    # Squaring the matrix six times is 64 power iterations; its columns then all point along the
    # longest axis, the one with the largest diagonal most surely. That is at least 3**-64.
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


@kernel
def _find_near(x: Vector, y: Vector, z: Vector, moments: Vector, is_near: _Flags) -> None:
    """Write which points lie on the near side of the cutting plane.

    The plane stands across the longest axis, through the mean.
    """
    a, b, c = _longest_axis(moments)
    mx, my, mz = moments[0], moments[1], moments[2]
    limit = -_ON_THE_PLANE * math.sqrt(moments[3] + moments[6] + moments[8])
    for i in range(x.shape[0]):
        is_near[i] = np.uint8(a * (x[i] - mx) + b * (y[i] - my) + c * (z[i] - mz) < limit)


@kernel
def _part_points(
    x: Vector, y: Vector, z: Vector, is_near: _Flags, to_x: Vector, to_y: Vector, to_z: Vector
) -> int:
    """Copy points, the near ones to the front and the others to the back; count the near."""
    front, back = np.uint64(0), np.uint64(x.shape[0] - 1)
    # Each is written to both ends, and only one of the two moves on: no branch to guess.
    for i in range(x.shape[0]):
        px, py, pz, near = x[i], y[i], z[i], np.uint64(is_near[i])
        to_x[front], to_y[front], to_z[front] = px, py, pz
        to_x[back], to_y[back], to_z[back] = px, py, pz
        front += near
        back -= np.uint64(1) - near
    return int(front)


@kernel
def _part_rows(rows: Vector, is_near: _Flags, to_rows: Vector) -> None:
    """Copy the rows of points as `_part_points` copies the points."""
    front, back = np.uint64(0), np.uint64(rows.shape[0] - 1)
    for i in range(rows.shape[0]):
        row, near = rows[i], np.uint64(is_near[i])
        to_rows[front] = row
        to_rows[back] = row
        front += near
        back -= np.uint64(1) - near


@kernel
def _cut_in_two(
    tables: NDArray[np.float64], at: int, begin: int, end: int, moments: Vector, is_near: _Flags
) -> int:
    """Copy a run to the other table, its near points first; return where the others begin."""
    to = 1 - at
    # Taken row by row, as only then is it clear that they are contiguous.
    x, y, z = tables[at, 0, begin:end], tables[at, 1, begin:end], tables[at, 2, begin:end]
    u, v, w = tables[to, 0, begin:end], tables[to, 1, begin:end], tables[to, 2, begin:end]
    _find_near(x, y, z, moments, is_near)
    near = _part_points(x, y, z, is_near, u, v, w)
    if tables.shape[1] == 4:
        _part_rows(tables[at, 3, begin:end], is_near, tables[to, 3, begin:end])
    return begin + near


@kernel
def _by_part(
    points: Points, labels: Labels, parts: int, keeps_rows: bool
) -> tuple[Labels, NDArray[np.float64]]:
    """Return where each part begins, and two times 3 or 4 rows: coordinates sorted by part.

    The fourth row holds the rows of `points`; the second three or four are left empty.
    """
    # Labels of -1 count in the first place, which no part needs.
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
            place = cursor[labels[i]]
            cursor[labels[i]] += 1
            x[place], y[place], z[place] = points[i, 0], points[i, 1], points[i, 2]
            if keeps_rows:
                tables[0, 3, place] = i
    return starts[1:], tables


@kernel
def cut_by_extent(
    points: Points, labels: Labels, parts: int, radii: Vector, keeps_rows: bool
) -> tuple[Labels, Labels, Matrix]:
    """Cut parts until none has a point farther than a radius from its mean, for each radius.

    A part that has is cut in two by the plane through its mean across its longest axis, again
    and again. Each cut depends only on the set of points, so neither their order nor the
    numbering of the parts changes which points stay together; points on the plane, but for
    rounding, go to the far side. Cutting to a smaller radius goes on from the larger one.

    Parameters
    ----------
    points : (n, 3) [m]
    labels : (n,)
        -1 for no part.
    parts : int
    radii : (r,) [m]
        Descending.
    keeps_rows : bool
        Whether to say which points the parts are made of; it takes time.

    Returns
    -------
    rows : (m,)
        The rows of all points that belong to a part, in an order in which all parts are runs;
        none unless asked for.
    runs : (k, 3)
        The index of a radius, where a part cut to it begins in `rows`, and where it ends.
    moments : (k, 9)
        Mean (3) [m] and packed covariance (6) [m^2] of each run, divided by the count.
    """
    # What is cut goes from one of the two tables to the other, and the next time back.
    starts, tables = _by_part(points, labels, parts, keeps_rows)
    n = tables.shape[2]
    rows = np.empty(n if keeps_rows else 0, np.int64)
    runs = np.empty((max(16, 4 * parts), 3), np.int64)
    moments = np.empty((runs.shape[0], 9), np.float64)
    own = np.empty(9, np.float64)
    is_near = np.empty(n, np.uint8)
    # A stack of runs still to be cut or kept: the radius they are cut to next, where they begin
    # and end, and their table; a run of one point is never cut.
    waiting = np.empty((n + 1, 4), np.int64)
    found = 0
    for k in range(parts):
        waiting[0, 0], waiting[0, 1], waiting[0, 2], waiting[0, 3] = 0, starts[k], starts[k + 1], 0
        depth = 1 if starts[k] < starts[k + 1] else 0
        while depth > 0:
            depth -= 1
            scale, begin, end, at = waiting[depth]
            x, y, z = tables[at, 0, begin:end], tables[at, 1, begin:end], tables[at, 2, begin:end]
            is_long = _fill_moments(x, y, z, float(radii[scale]), own)
            while scale < radii.shape[0]:
                if is_long:
                    middle = _cut_in_two(tables, at, begin, end, own, is_near)
                    if begin < middle < end:
                        for first, last in ((begin, middle), (middle, end)):
                            waiting[depth, 0], waiting[depth, 1] = scale, first
                            waiting[depth, 2], waiting[depth, 3] = last, 1 - at
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
                        rows[p] = np.int64(tables[at, 3, p])
    return rows, runs[:found].copy(), moments[:found].copy()
