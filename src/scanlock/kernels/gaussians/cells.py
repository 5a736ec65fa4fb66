"""P2D over the cells of a grid: a hash of the occupied cells, and the score of the points in them.

A point ``y`` in the target's frame scores ``f(y)``, the sum over the cells that it meets. With the
gradient ``g`` and the Hessian ``H`` of f in y, the step ``(rho, phi)`` has::

    gradient  (g, y x g)
    Hessian   J' H J + blkdiag(0, (g y' + y g') / 2 - (g.y) I),  J = [I, -hat(y)]

so g and H are summed over the cells first, and the pose enters once a point. The score of a pair
and its window are those of `kernels/gaussians/p2d.py`; every kernel returns 28 sums in its order.
"""

import math

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector
from scanlock.kernels._compile import kernel, sum_kernel, sum_part

_LOW_BITS = (1 << 20) - 1
"""What the hash takes of an index, so that no product overflows."""


@kernel
def _slot(i: int, j: int, k: int, last: int) -> int:
    """Return where the search for a cell begins (Teschner et al. 2003)."""
    return (
        ((i & _LOW_BITS) * 73856093) ^ ((j & _LOW_BITS) * 19349663) ^ ((k & _LOW_BITS) * 83492791)
    ) & last


@kernel
def cell_table(cells: Labels, slots: int) -> Labels:
    """Return the (slots,) hash of (k, 3) distinct cells: the row of a cell, -1 where empty.

    `slots` is a power of two above k; rows are put into the first empty slot from their own on.
    """
    table = np.full(slots, -1, np.int64)
    last = slots - 1
    for row in range(cells.shape[0]):
        slot = _slot(cells[row, 0], cells[row, 1], cells[row, 2], last)
        while table[slot] >= 0:
            slot = (slot + 1) & last
        table[slot] = row
    return table


@kernel
def _row_of(table: Labels, cells: Labels, i: int, j: int, k: int) -> int:
    """Return the row of a cell, or -1 where nothing is known of it."""
    last = table.shape[0] - 1
    slot = _slot(i, j, k, last)
    row = table[slot]
    while row >= 0 and not (cells[row, 0] == i and cells[row, 1] == j and cells[row, 2] == k):
        slot = (slot + 1) & last
        row = table[slot]
    return int(row)


@kernel
def rows_at(points: Points, table: Labels, cells: Labels, width: float) -> Labels:
    """Return (m,) the row of the cell that each point lies in; -1 where nothing is known of it.

    Cells are indices in widths from zero.
    """
    rows = np.empty(points.shape[0], np.int64)
    # Neighbours in memory mostly share a cell; no cell has this index.
    last_i = last_j = last_k = np.iinfo(np.int64).min
    row = -1
    for p in range(points.shape[0]):
        i = math.floor(points[p, 0] / width)
        j = math.floor(points[p, 1] / width)
        k = math.floor(points[p, 2] / width)
        if i != last_i or j != last_j or k != last_k:
            row = _row_of(table, cells, i, j, k)
            last_i, last_j, last_k = i, j, k
        rows[p] = row
    return rows


@kernel
def rows_within(
    points: Points, table: Labels, cells: Labels, corner: Vector, width: float, reach: int
) -> tuple[Labels, Labels]:
    """Return the cells at most `reach` cells along each axis from the cell of each (m, 3) point.

    Those of point i are ``members[starts[i] : starts[i + 1]]``.
    """
    n = points.shape[0]
    starts = np.zeros(n + 1, np.int64)
    members = np.empty(0, np.int64)
    for fill in range(2):
        if fill == 1:
            members = np.empty(starts[n], np.int64)
        found = 0
        for p in range(n):
            i0 = math.floor((points[p, 0] - corner[0]) / width)
            j0 = math.floor((points[p, 1] - corner[1]) / width)
            k0 = math.floor((points[p, 2] - corner[2]) / width)
            for i in range(i0 - reach, i0 + reach + 1):
                for j in range(j0 - reach, j0 + reach + 1):
                    for k in range(k0 - reach, k0 + reach + 1):
                        row = _row_of(table, cells, i, j, k)
                        if row < 0:
                            continue
                        if fill == 1:
                            members[found] = row
                        found += 1
            starts[p + 1] = found
    return starts, members


@kernel
def _score(
    squared: float, sharpness: float, window_start: float, window_end: float
) -> tuple[float, float, float]:
    """Return the score of a pair and its first two derivatives in the squared distance."""
    score = -math.exp(-0.5 * sharpness * squared)
    slope = -0.5 * sharpness * score
    curve = -0.5 * sharpness * slope
    if squared <= window_start:
        return score, slope, curve
    span = window_end - window_start
    v = (squared - window_start) / span
    window = 1.0 - v * v * v * (10.0 - 15.0 * v + 6.0 * v * v)
    window_slope = -30.0 * v * v * (1.0 - v) * (1.0 - v) / span
    window_curve = -60.0 * v * (1.0 - v) * (1.0 - 2.0 * v) / (span * span)
    return (
        score * window,
        slope * window + score * window_slope,
        curve * window + 2.0 * slope * window_slope + score * window_curve,
    )


@sum_part
def _add_cell(
    sums: Vector, means: Points, precisions: Matrix, row: int, y0: float, y1: float, y2: float,
    w: float, w0: float, w1: float, w2: float, w01: float, w02: float, w12: float,
    sharpness: float, window_start: float, window_end: float, exact: float,
) -> None:  # fmt: skip
    """Add the score of a point under one cell, times a weight, to the 10 sums f, g and H.

    The weight w has the gradient (w0, w1, w2) and the mixed second derivatives w01, w02, w12;
    the others are zero. With `exact` 0 instead of 1, H is its convex part ``w slope 2 B``.
    """
    q0, q1, q2 = y0 - means[row, 0], y1 - means[row, 1], y2 - means[row, 2]
    k00, k01, k02 = precisions[row, 0], precisions[row, 1], precisions[row, 2]
    k11, k12, k22 = precisions[row, 3], precisions[row, 4], precisions[row, 5]
    b0 = k00 * q0 + k01 * q1 + k02 * q2
    b1 = k01 * q0 + k11 * q1 + k12 * q2
    b2 = k02 * q0 + k12 * q1 + k22 * q2
    squared = b0 * q0 + b1 * q1 + b2 * q2
    if squared >= window_end:
        return
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


@sum_kernel
def _add_point(terms: Vector, sums: Vector, y0: float, y1: float, y2: float, exact: float) -> None:
    """Add the 28 terms of a point of the 10 sums f, g and H."""
    g0, g1, g2 = sums[1], sums[2], sums[3]
    h00, h01, h02, h11, h12, h22 = sums[4], sums[5], sums[6], sums[7], sums[8], sums[9]
    # N = H hat(y); J' H J has the blocks H, -N and hat(y)' N.
    n00, n01, n02 = h01 * y2 - h02 * y1, h02 * y0 - h00 * y2, h00 * y1 - h01 * y0
    n10, n11, n12 = h11 * y2 - h12 * y1, h12 * y0 - h01 * y2, h01 * y1 - h11 * y0
    n20, n21, n22 = h12 * y2 - h22 * y1, h22 * y0 - h02 * y2, h02 * y1 - h12 * y0
    half0, half1, half2 = 0.5 * exact * g0, 0.5 * exact * g1, 0.5 * exact * g2
    terms[0] += sums[0]
    terms[1] += g0
    terms[2] += g1
    terms[3] += g2
    terms[4] += y1 * g2 - y2 * g1
    terms[5] += y2 * g0 - y0 * g2
    terms[6] += y0 * g1 - y1 * g0
    terms[7] += h00
    terms[8] += h01
    terms[9] += h02
    terms[10] -= n00
    terms[11] -= n01
    terms[12] -= n02
    terms[13] += h11
    terms[14] += h12
    terms[15] -= n10
    terms[16] -= n11
    terms[17] -= n12
    terms[18] += h22
    terms[19] -= n20
    terms[20] -= n21
    terms[21] -= n22
    terms[22] += y2 * n10 - y1 * n20 - 2.0 * (half1 * y1 + half2 * y2)
    terms[23] += y2 * n11 - y1 * n21 + half0 * y1 + half1 * y0
    terms[24] += y2 * n12 - y1 * n22 + half0 * y2 + half2 * y0
    terms[25] += y0 * n21 - y2 * n01 - 2.0 * (half0 * y0 + half2 * y2)
    terms[26] += y0 * n22 - y2 * n02 + half1 * y2 + half2 * y1
    terms[27] += y1 * n02 - y0 * n12 - 2.0 * (half0 * y0 + half1 * y1)


@kernel
def _rows_around(
    table: Labels, cells: Labels, offsets: Labels, i: int, j: int, k: int, rows: Labels
) -> int:
    """Write the rows of the cells at offsets from one that are known; return how many."""
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
    width: float,
    offsets: Labels,
    reach: float,
    rotation: Matrix,
    translation: Vector,
    sharpness: float,
    window_start: float,
    window_end: float,
    exact: float,
) -> Vector:
    """Return the 28 sums over all points and the cells at (m, 3) offsets from their own.

    Cells whose mean lies `reach` [m] or more away from the point are left out.
    """
    terms = np.zeros(28)
    sums = np.zeros(10)
    # Neighbours in memory often share a cell, and what is around it; no cell has this index.
    rows, met = np.empty(offsets.shape[0], np.int64), 0
    last_i = last_j = last_k = np.iinfo(np.int64).min
    r00, r01, r02 = rotation[0, 0], rotation[0, 1], rotation[0, 2]
    r10, r11, r12 = rotation[1, 0], rotation[1, 1], rotation[1, 2]
    r20, r21, r22 = rotation[2, 0], rotation[2, 1], rotation[2, 2]
    for p in range(points.shape[0]):
        x0, x1, x2 = points[p, 0], points[p, 1], points[p, 2]
        y0 = r00 * x0 + r01 * x1 + r02 * x2 + translation[0]
        y1 = r10 * x0 + r11 * x1 + r12 * x2 + translation[1]
        y2 = r20 * x0 + r21 * x1 + r22 * x2 + translation[2]
        i = math.floor((y0 - corner[0]) / width)
        j = math.floor((y1 - corner[1]) / width)
        k = math.floor((y2 - corner[2]) / width)
        if i != last_i or j != last_j or k != last_k:
            met = _rows_around(table, cells, offsets, i, j, k, rows)
            last_i, last_j, last_k = i, j, k
        if met == 0:
            continue
        sums[:] = 0.0
        for one in range(met):
            row = rows[one]
            q0, q1, q2 = y0 - means[row, 0], y1 - means[row, 1], y2 - means[row, 2]
            if q0 * q0 + q1 * q1 + q2 * q2 >= reach * reach:
                continue
            _add_cell(
                sums, means, precisions, row, y0, y1, y2, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
                sharpness, window_start, window_end, exact,
            )  # fmt: skip
        if sums[0] < 0.0:
            _add_point(terms, sums, y0, y1, y2, exact)
    return terms


@sum_kernel
def trilinear_terms(
    points: Points,
    means: Points,
    precisions: Matrix,
    table: Labels,
    cells: Labels,
    corner: Vector,
    width: float,
    rotation: Matrix,
    translation: Vector,
    sharpness: float,
    window_start: float,
    window_end: float,
    exact: float,
) -> Vector:
    """Return the 28 sums over all points and the 8 cells whose middles surround each point.

    Along each axis a cell weighs 1 less the distance from its middle in widths (Magnusson et al.
    2007), and the derivatives of the weights are part of those of the score.
    """
    terms = np.zeros(28)
    sums = np.zeros(10)
    r00, r01, r02 = rotation[0, 0], rotation[0, 1], rotation[0, 2]
    r10, r11, r12 = rotation[1, 0], rotation[1, 1], rotation[1, 2]
    r20, r21, r22 = rotation[2, 0], rotation[2, 1], rotation[2, 2]
    for p in range(points.shape[0]):
        x0, x1, x2 = points[p, 0], points[p, 1], points[p, 2]
        y0 = r00 * x0 + r01 * x1 + r02 * x2 + translation[0]
        y1 = r10 * x0 + r11 * x1 + r12 * x2 + translation[1]
        y2 = r20 * x0 + r21 * x1 + r22 * x2 + translation[2]
        # In widths from the middle of the first of the 8 cells.
        v0 = (y0 - corner[0]) / width - 0.5
        v1 = (y1 - corner[1]) / width - 0.5
        v2 = (y2 - corner[2]) / width - 0.5
        i, j, k = math.floor(v0), math.floor(v1), math.floor(v2)
        v0, v1, v2 = v0 - i, v1 - j, v2 - k
        sums[:] = 0.0
        for corner_cell in range(8):
            a, b, c = corner_cell & 1, (corner_cell >> 1) & 1, corner_cell >> 2
            row = _row_of(table, cells, i + a, j + b, k + c)
            if row < 0:
                continue
            # Each factor of the weight, and its derivative in y.
            f0, s0 = (v0, 1.0 / width) if a == 1 else (1.0 - v0, -1.0 / width)
            f1, s1 = (v1, 1.0 / width) if b == 1 else (1.0 - v1, -1.0 / width)
            f2, s2 = (v2, 1.0 / width) if c == 1 else (1.0 - v2, -1.0 / width)
            _add_cell(
                sums, means, precisions, row, y0, y1, y2, f0 * f1 * f2,
                s0 * f1 * f2, f0 * s1 * f2, f0 * f1 * s2,
                s0 * s1 * f2, s0 * f1 * s2, f0 * s1 * s2,
                sharpness, window_start, window_end, exact,
            )  # fmt: skip
        if sums[0] < 0.0:
            _add_point(terms, sums, y0, y1, y2, exact)
    return terms
