"""P2D over the cells of a grid: hash table of the occupied cells, and scores of points in them.

A point ``y`` in the target's frame scores ``f(y)``, the sum over its corresponding cells. With the
gradient ``g`` and the Hessian ``H`` of f in y, the derivatives for the step ``(rho, phi)`` are::

    gradient  (g, y x g)
    Hessian   J' H J + blkdiag(0, (g y' + y g') / 2 - (g.y) I),  J = [I, -hat(y)]

So g and H are summed over the cells first, and the pose enters once per point. The score of a pair
and its window are those of `kernels/gaussians/p2d.py`; every kernel returns 28 terms in its order.
"""

import math

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector
from scanlock.kernels._compile import helper, inlined, kernel, sum_helper, sum_kernel
from scanlock.kernels._inline import (
    Triple,
    add_point_terms,
    dot,
    find_voxel,
    nine,
    product,
    symmetric,
    transformed,
    triple,
    voxel_slot,
    window,
    windowed,
)

_Weight = tuple[float, float, float, float, float, float, float]
"""Weight w of a cell, its gradient w0, w1, w2 and its mixed second derivatives w01, w02, w12."""

_Shape = tuple[float, float, float, float]
"""Sharpness, window start, window end, and 1 for the exact Hessian or 0 for its convex part."""


@kernel
def cell_table(cells: Labels, slots: int) -> Labels:
    """Return the (slots,) hash table of (k, 3) distinct cells: rows of `cells`, -1 where empty.

    `slots` is a power of two above k; collisions are resolved by linear probing.
    """
    table = np.full(slots, -1, np.int64)
    last = slots - 1
    for row in range(cells.shape[0]):
        # Unsigned, because Numba checks the sign of other indices.
        slot = np.uint64(voxel_slot(cells[row, 0], cells[row, 1], cells[row, 2], last))
        while table[slot] >= 0:
            slot = (slot + np.uint64(1)) & np.uint64(last)
        table[slot] = row
    return table


@helper
def _row_of(table: Labels, cells: Labels, i: int, j: int, k: int) -> int:
    """Return the row of a cell, or -1 if it is not in the table."""
    return int(find_voxel(table, cells, i, j, k)[1])


@kernel
def cell_rows(points: Points, table: Labels, cells: Labels, cell_size: float) -> Labels:
    """Return the row of the cell that contains each of (m, 3) points; -1 if it is not in the table.

    Cell (0, 0, 0) begins at the origin.
    """
    rows = np.empty(points.shape[0], np.int64)
    # Consecutive points mostly share a cell; no cell has this index.
    last_i = last_j = last_k = np.iinfo(np.int64).min
    row = -1
    for p in range(points.shape[0]):
        i = math.floor(points[p, 0] / cell_size)
        j = math.floor(points[p, 1] / cell_size)
        k = math.floor(points[p, 2] / cell_size)
        if i != last_i or j != last_j or k != last_k:
            row = _row_of(table, cells, i, j, k)
            last_i, last_j, last_k = i, j, k
        rows[p] = row
    return rows


@kernel
def neighbour_cell_rows(
    points: Points, table: Labels, cells: Labels, corner: Vector, cell_size: float, radius: int
) -> tuple[Labels, Labels]:
    """Return the occupied cells within `radius` cells of each point's cell, along each axis.

    Parameters
    ----------
    points : (m, 3) [m]
    table, cells
        Those of `cell_table`.
    corner : (3,) [m]
        Corner of cell (0, 0, 0).
    cell_size : float [m]
    radius : int

    Returns
    -------
    starts, members
        Point i has the rows ``members[starts[i] : starts[i + 1]]``.
    """
    n = points.shape[0]
    starts = np.zeros(n + 1, np.int64)
    members = np.empty(0, np.int64)
    # The first pass counts, the second writes.
    for is_second in range(2):
        if is_second == 1:
            members = np.empty(starts[n], np.int64)
        found = 0
        for p in range(n):
            i0 = math.floor((points[p, 0] - corner[0]) / cell_size)
            j0 = math.floor((points[p, 1] - corner[1]) / cell_size)
            k0 = math.floor((points[p, 2] - corner[2]) / cell_size)
            for i in range(i0 - radius, i0 + radius + 1):
                for j in range(j0 - radius, j0 + radius + 1):
                    for k in range(k0 - radius, k0 + radius + 1):
                        row = _row_of(table, cells, i, j, k)
                        if row < 0:
                            continue
                        if is_second == 1:
                            members[found] = row
                        found += 1
            starts[p + 1] = found
    return starts, members


@helper
def _score(squared: float, sharpness: float, window_start: float, window_end: float) -> Triple:
    """Return the score of a pair and its first two derivatives in the squared distance."""
    score = -math.exp(-0.5 * sharpness * squared)
    slope = -0.5 * sharpness * score
    curve = -0.5 * sharpness * slope
    if squared <= window_start:
        return score, slope, curve
    span = window_end - window_start
    w, w1, w2 = window((squared - window_start) / span)
    return windowed(score, slope, curve, w, w1 / span, w2 / (span * span))


@inlined
def _add_cell(
    sums: Vector, means: Points, precisions: Matrix, row: int, y: Triple,
    weight: _Weight, shape: _Shape,
) -> None:  # fmt: skip
    """Add the weighted score of a point in one cell to the 10 sums f, g and H.

    The second derivatives of the weight along one axis are zero. The convex part of H is
    ``w slope 2 B``.
    """
    q = y[0] - means[row, 0], y[1] - means[row, 1], y[2] - means[row, 2]
    k00, k01, k02, k11, k12, k22 = k = symmetric(precisions, row)
    b0, b1, b2 = b = product(k, q)
    squared = dot(b, q)
    sharpness, window_start, window_end, exact = shape
    if squared >= window_end:
        return
    w, w0, w1, w2, w01, w02, w12 = weight
    score, slope, curve = _score(squared, sharpness, window_start, window_end)
    slope *= 2.0
    g0, g1, g2 = slope * b0, slope * b1, slope * b2
    slope *= w
    curve *= 4.0 * w * exact
    sums[0] += w * score
    sums[1] += w * g0 + score * w0
    sums[2] += w * g1 + score * w1
    sums[3] += w * g2 + score * w2
    sums[4] += slope * k00 + curve * b0 * b0 + exact * (2.0 * g0 * w0)
    sums[5] += slope * k01 + curve * b0 * b1 + exact * (g0 * w1 + g1 * w0 + score * w01)
    sums[6] += slope * k02 + curve * b0 * b2 + exact * (g0 * w2 + g2 * w0 + score * w02)
    sums[7] += slope * k11 + curve * b1 * b1 + exact * (2.0 * g1 * w1)
    sums[8] += slope * k12 + curve * b1 * b2 + exact * (g1 * w2 + g2 * w1 + score * w12)
    sums[9] += slope * k22 + curve * b2 * b2 + exact * (2.0 * g2 * w2)


@sum_helper
def _add_point(terms: Vector, sums: Vector, y: Triple, exact: float) -> None:
    """Add the 28 terms of a point, given its 10 sums f, g and H."""
    g = sums[1], sums[2], sums[3]
    h = sums[4], sums[5], sums[6], sums[7], sums[8], sums[9]
    add_point_terms(terms, sums[0], y, g, h, exact)


@helper
def _rows_at_offsets(
    table: Labels, cells: Labels, offsets: Labels, i: int, j: int, k: int, rows: Labels
) -> int:
    """Write the rows of the occupied cells at offsets from one cell; return their number."""
    found = 0
    for o in range(offsets.shape[0]):
        rows[found] = _row_of(table, cells, i + offsets[o, 0], j + offsets[o, 1], k + offsets[o, 2])
        found += rows[found] >= 0
    return found


@sum_kernel
def cell_terms(
    points: Points,
    means: Points,
    precisions: Matrix,
    table: Labels,
    cells: Labels,
    corner: Vector,
    cell_size: float,
    offsets: Labels,
    max_distance: float,
    rotation: Matrix,
    translation: Vector,
    sharpness: float,
    window_start: float,
    window_end: float,
    exact: float,
) -> Vector:
    """Return the 28 sums over all points and the cells at given offsets from the points' cells.

    Parameters
    ----------
    points : (n, 3) [m]
        Of the source.
    means, precisions : (k, 3) [m], (k, 6) [m^-2]
        Gaussians of the target's cells; packed inverse covariances.
    table, cells
        Those of `cell_table`.
    corner, cell_size : (3,), float [m]
        Corner of cell (0, 0, 0) and side of a cell.
    offsets : (m, 3)
        Of the corresponding cells, in cells.
    max_distance : float [m]
        Cells whose mean is this far from the point or farther are left out.
    rotation, translation : (3, 3), (3,) [m]
        Pose of the source in the target's frame.
    sharpness, window_start, window_end : float
        As in `kernels/gaussians/p2d.py`.
    exact : float
        1 for the exact Hessian, 0 for its convex part.
    """
    terms = np.zeros(28)
    sums = np.zeros(10)
    weight = 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    shape = sharpness, window_start, window_end, exact
    # Consecutive points often share a cell and its neighbours; no cell has this index.
    rows, count = np.empty(offsets.shape[0], np.int64), 0
    last_i = last_j = last_k = np.iinfo(np.int64).min
    r, t = nine(rotation), triple(translation)
    for p in range(points.shape[0]):
        y0, y1, y2 = y = transformed(r, t, points[p, 0], points[p, 1], points[p, 2])
        i = math.floor((y0 - corner[0]) / cell_size)
        j = math.floor((y1 - corner[1]) / cell_size)
        k = math.floor((y2 - corner[2]) / cell_size)
        if i != last_i or j != last_j or k != last_k:
            count = _rows_at_offsets(table, cells, offsets, i, j, k, rows)
            last_i, last_j, last_k = i, j, k
        if count == 0:
            continue
        sums[:] = 0.0
        for c in range(count):
            row = rows[c]
            q0, q1, q2 = y0 - means[row, 0], y1 - means[row, 1], y2 - means[row, 2]
            if q0 * q0 + q1 * q1 + q2 * q2 < max_distance * max_distance:
                _add_cell(sums, means, precisions, row, y, weight, shape)
        if sums[0] < 0.0:
            _add_point(terms, sums, y, exact)
    return terms


@sum_kernel
def trilinear_terms(
    points: Points,
    means: Points,
    precisions: Matrix,
    table: Labels,
    cells: Labels,
    corner: Vector,
    cell_size: float,
    rotation: Matrix,
    translation: Vector,
    sharpness: float,
    window_start: float,
    window_end: float,
    exact: float,
) -> Vector:
    """Return the 28 sums over all points and the 8 cells whose centres surround each point.

    Along each axis the weight of a cell is 1 less the distance to its centre in cells (Magnusson
    et al. 2007); the derivatives of the weights are part of those of the score. The parameters
    are those of `cell_terms`.
    """
    terms = np.zeros(28)
    sums = np.zeros(10)
    shape = sharpness, window_start, window_end, exact
    r, t = nine(rotation), triple(translation)
    for p in range(points.shape[0]):
        y0, y1, y2 = y = transformed(r, t, points[p, 0], points[p, 1], points[p, 2])
        # In cells from the centre of the first of the 8 cells.
        v0 = (y0 - corner[0]) / cell_size - 0.5
        v1 = (y1 - corner[1]) / cell_size - 0.5
        v2 = (y2 - corner[2]) / cell_size - 0.5
        i, j, k = math.floor(v0), math.floor(v1), math.floor(v2)
        v0, v1, v2 = v0 - i, v1 - j, v2 - k
        sums[:] = 0.0
        for c in range(8):
            c0, c1, c2 = c & 1, (c >> 1) & 1, c >> 2
            row = _row_of(table, cells, i + c0, j + c1, k + c2)
            if row < 0:
                continue
            # Each factor of the weight, and its derivative in y.
            f0, s0 = (v0, 1.0 / cell_size) if c0 == 1 else (1.0 - v0, -1.0 / cell_size)
            f1, s1 = (v1, 1.0 / cell_size) if c1 == 1 else (1.0 - v1, -1.0 / cell_size)
            f2, s2 = (v2, 1.0 / cell_size) if c2 == 1 else (1.0 - v2, -1.0 / cell_size)
            weight = (
                f0 * f1 * f2,
                s0 * f1 * f2, f0 * s1 * f2, f0 * f1 * s2,
                s0 * s1 * f2, s0 * f1 * s2, f0 * s1 * s2,
            )  # fmt: skip
            _add_cell(sums, means, precisions, row, y, weight, shape)
        if sums[0] < 0.0:
            _add_point(terms, sums, y, exact)
    return terms
