"""Parts that are too long, cut in two again and again, and the moments of what is left."""

import math

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector
from scanlock.kernels._compile import kernel, sum_kernel

_ON_THE_PLANE = 1e-9
"""Share of a part's deviation within which a point counts as on the cutting plane."""


@sum_kernel
def _fill_moments(x: Vector, y: Vector, z: Vector, moments: Vector) -> None:
    """Write the mean (3) and the packed covariance (6) of points; in two passes, as digits go."""
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
    moments[0], moments[1], moments[2] = mx, my, mz
    moments[3], moments[4], moments[5] = xx / n, xy / n, xz / n
    moments[6], moments[7], moments[8] = yy / n, yz / n, zz / n


@sum_kernel
def _reaches_beyond(x: Vector, y: Vector, z: Vector, moments: Vector, radius: float) -> bool:
    """Tell whether any point is farther than `radius` from the mean."""
    beyond = 0
    # Counting uses vector units; the largest distance would not.
    for i in range(x.shape[0]):
        dx = x[i] - moments[0]
        dy = y[i] - moments[1]
        dz = z[i] - moments[2]
        beyond += dx * dx + dy * dy + dz * dz > radius * radius
    return beyond > 0


@kernel
def _longest_axis(moments: Vector) -> tuple[float, float, float]:
    """Return the unit vector of the largest variance; zero where there is no variance."""
    xx, xy, xz = moments[3], moments[4], moments[5]
    yy, yz, zz = moments[6], moments[7], moments[8]
    # Squaring the matrix six times is 64 power iterations; its columns then all point along the
    # longest axis, the one with the largest diagonal most surely.
    for _ in range(6):
        size = xx + yy + zz
        if size == 0.0:
            break
        xx, xy, xz, yy, yz, zz = xx / size, xy / size, xz / size, yy / size, yz / size, zz / size
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
    return (a / norm, b / norm, c / norm) if norm > 0.0 else (0.0, 0.0, 0.0)


@kernel
def _part_in_two(
    x: Vector, y: Vector, z: Vector, rows: Labels, moments: Vector, far: Matrix, far_rows: Labels
) -> int:
    """Move the points on the near side of the cutting plane to the front; return their number.

    The plane stands across the longest axis, through the mean. `far` (3, n) and `far_rows` are
    scratch.
    """
    a, b, c = _longest_axis(moments)
    spread = math.sqrt(moments[3] + moments[6] + moments[8])
    near = np.uint64(0)
    behind = np.uint64(0)
    # Every point is written to both sides, and only one of the two moves on: no branch to guess.
    for i in range(x.shape[0]):
        px, py, pz, row = x[i], y[i], z[i], rows[i]
        along = a * (px - moments[0]) + b * (py - moments[1]) + c * (pz - moments[2])
        is_near = np.uint64(along < -_ON_THE_PLANE * spread)
        x[near], y[near], z[near], rows[near] = px, py, pz, row
        far[0, behind], far[1, behind], far[2, behind], far_rows[behind] = px, py, pz, row
        near += is_near
        behind += np.uint64(1) - is_near
    middle = int(near)
    for i in range(x.shape[0] - middle):
        x[middle + i], y[middle + i], z[middle + i] = far[0, i], far[1, i], far[2, i]
        rows[middle + i] = far_rows[i]
    return middle


@kernel
def cut_by_extent(
    points: Points, labels: Labels, parts: int, radii: Vector
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

    Returns
    -------
    rows : (m,)
        The rows of all points that belong to a part, in an order in which all parts are runs.
    runs : (k, 3)
        The index of a radius, where a part cut to it begins in `rows`, and where it ends.
    moments : (k, 9)
        Mean (3) [m] and packed covariance (6) [m^2] of each run, divided by the count.
    """
    starts = np.zeros(parts + 1, np.int64)
    for i in range(points.shape[0]):
        if labels[i] >= 0:
            starts[labels[i] + 1] += 1
    for k in range(parts):
        starts[k + 1] += starts[k]
    n = starts[parts]
    x, y, z = np.empty(n), np.empty(n), np.empty(n)
    rows = np.empty(n, np.int64)
    cursor = starts[:-1].copy()
    for i in range(points.shape[0]):
        if labels[i] >= 0:
            place = cursor[labels[i]]
            cursor[labels[i]] += 1
            x[place], y[place], z[place] = points[i, 0], points[i, 1], points[i, 2]
            rows[place] = i

    runs = np.empty((max(16, 4 * parts), 3), np.int64)
    moments = np.empty((runs.shape[0], 9), np.float64)
    own = np.empty(9, np.float64)
    far = np.empty((3, n), np.float64)
    far_rows = np.empty(n, np.int64)
    # A stack of runs still to be cut or kept, and the radius they are cut to next; a run of one
    # point is never cut.
    waiting = np.empty((n + 1, 3), np.int64)
    found = 0
    for k in range(parts):
        if starts[k] == starts[k + 1]:
            continue
        waiting[0, 0], waiting[0, 1], waiting[0, 2] = 0, starts[k], starts[k + 1]
        depth = 1
        while depth > 0:
            depth -= 1
            scale, begin, end = waiting[depth, 0], waiting[depth, 1], waiting[depth, 2]
            px, py, pz = x[begin:end], y[begin:end], z[begin:end]
            _fill_moments(px, py, pz, own)
            while scale < radii.shape[0]:
                if _reaches_beyond(px, py, pz, own, float(radii[scale])):
                    middle = begin + _part_in_two(px, py, pz, rows[begin:end], own, far, far_rows)
                    if begin < middle < end:
                        for half in range(2):
                            waiting[depth, 0] = scale
                            waiting[depth, 1] = begin if half == 0 else middle
                            waiting[depth, 2] = middle if half == 0 else end
                            depth += 1
                        break
                if found == runs.shape[0]:
                    runs = np.concatenate((runs, np.empty_like(runs)))
                    moments = np.concatenate((moments, np.empty_like(moments)))
                runs[found, 0], runs[found, 1], runs[found, 2] = scale, begin, end
                moments[found] = own
                found += 1
                scale += 1
    return rows, runs[:found].copy(), moments[:found].copy()
