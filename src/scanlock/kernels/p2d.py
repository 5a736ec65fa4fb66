"""Sum of the point-to-distribution score over all points and all Gaussians within reach.

With ``y = R x + t``, ``q = y - mu``, ``b = B q`` for the precision B, the squared distance
``s = q' B q`` has, for the step ``(rho, phi)``::

    gradient  2 (b, y x b)
    Hessian   2 L' B L + blkdiag(0, b y' + y b' - 2 (b.y) I),   L = [I, -hat(y)]

which is Magnusson 2009, section 6.2.1, in a left perturbation.
"""

import math

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector
from scanlock.kernels._compile import kernel


@kernel
def tile_lists(
    means: Points, radii: Vector, corner: Vector, width: float, columns: int, rows: int
) -> tuple[Labels, Labels]:
    """Return which Gaussians reach into each square tile of the xy plane.

    Tile ``row * columns + column`` starts at ``corner + width * (column, row)``; its Gaussians
    are ``members[starts[tile] : starts[tile + 1]]``, ascending. A Gaussian reaches a tile when
    the disc of its radius does.
    """
    tiles = columns * rows
    starts = np.zeros(tiles + 1, np.int64)
    members = np.empty(0, np.int64)
    cursor = np.empty(0, np.int64)
    for fill in range(2):
        if fill == 1:
            for tile in range(tiles):
                starts[tile + 1] += starts[tile]
            members = np.empty(starts[tiles], np.int64)
            cursor = starts[:-1].copy()
        for j in range(means.shape[0]):
            x = means[j, 0] - corner[0]
            y = means[j, 1] - corner[1]
            first_column = max(0, math.floor((x - radii[j]) / width))
            last_column = min(columns - 1, math.floor((x + radii[j]) / width))
            first_row = max(0, math.floor((y - radii[j]) / width))
            last_row = min(rows - 1, math.floor((y + radii[j]) / width))
            for row in range(first_row, last_row + 1):
                gap_y = max(row * width - y, y - (row + 1) * width, 0.0)
                for column in range(first_column, last_column + 1):
                    gap_x = max(column * width - x, x - (column + 1) * width, 0.0)
                    if gap_x * gap_x + gap_y * gap_y > radii[j] * radii[j]:
                        continue
                    tile = row * columns + column
                    if fill == 0:
                        starts[tile + 1] += 1
                    else:
                        members[cursor[tile]] = j
                        cursor[tile] += 1
    return starts, members


@kernel
def p2d_terms(
    points: Points,
    means: Points,
    precisions: Matrix,
    starts: Labels,
    members: Labels,
    corner: Vector,
    width: float,
    columns: int,
    rows: int,
    rotation: Matrix,
    translation: Vector,
    sharpness: float,
    window_start: float,
    window_end: float,
) -> Vector:
    """Return value, gradient (6), upper triangle of the Hessian (21), its convex part (21).

    `precisions` (k, 6) are packed inverses of the covariances; `starts`, `members` are the
    lists of `tile_lists`, so a point outside all tiles meets nothing. The window is that of
    `scanlock.kernels.d2d`.
    """
    terms = np.zeros(49)
    gradient = np.empty(6)
    jacobian = np.zeros((3, 6))
    weighted = np.empty((3, 6))
    bend = np.empty((3, 3))
    jacobian[0, 0] = 1.0
    jacobian[1, 1] = 1.0
    jacobian[2, 2] = 1.0
    span = window_end - window_start

    for i in range(points.shape[0]):
        x0, x1, x2 = points[i, 0], points[i, 1], points[i, 2]
        y0 = rotation[0, 0] * x0 + rotation[0, 1] * x1 + rotation[0, 2] * x2 + translation[0]
        y1 = rotation[1, 0] * x0 + rotation[1, 1] * x1 + rotation[1, 2] * x2 + translation[1]
        y2 = rotation[2, 0] * x0 + rotation[2, 1] * x1 + rotation[2, 2] * x2 + translation[2]
        column = math.floor((y0 - corner[0]) / width)
        row = math.floor((y1 - corner[1]) / width)
        if column < 0 or column >= columns or row < 0 or row >= rows:
            continue
        tile = row * columns + column
        for m in range(starts[tile], starts[tile + 1]):
            j = members[m]
            q0 = y0 - means[j, 0]
            q1 = y1 - means[j, 1]
            q2 = y2 - means[j, 2]
            b00, b01, b02 = precisions[j, 0], precisions[j, 1], precisions[j, 2]
            b11, b12, b22 = precisions[j, 3], precisions[j, 4], precisions[j, 5]
            p0 = b00 * q0 + b01 * q1 + b02 * q2
            p1 = b01 * q0 + b11 * q1 + b12 * q2
            p2 = b02 * q0 + b12 * q1 + b22 * q2
            squared = p0 * q0 + p1 * q1 + p2 * q2
            if squared >= window_end:
                continue

            # Score of the pair and its first two derivatives in s.
            score = -math.exp(-0.5 * sharpness * squared)
            slope = -0.5 * sharpness * score
            curve = -0.5 * sharpness * slope
            if squared > window_start:
                v = (squared - window_start) / span
                window = 1.0 - v * v * v * (10.0 - 15.0 * v + 6.0 * v * v)
                window_slope = -30.0 * v * v * (1.0 - v) * (1.0 - v) / span
                window_curve = -60.0 * v * (1.0 - v) * (1.0 - 2.0 * v) / (span * span)
                curve = curve * window + 2.0 * slope * window_slope + score * window_curve
                slope = slope * window + score * window_slope
                score = score * window

            gradient[0] = 2.0 * p0
            gradient[1] = 2.0 * p1
            gradient[2] = 2.0 * p2
            gradient[3] = 2.0 * (y1 * p2 - y2 * p1)
            gradient[4] = 2.0 * (y2 * p0 - y0 * p2)
            gradient[5] = 2.0 * (y0 * p1 - y1 * p0)
            jacobian[0, 4] = y2
            jacobian[0, 5] = -y1
            jacobian[1, 3] = -y2
            jacobian[1, 5] = y0
            jacobian[2, 3] = y1
            jacobian[2, 4] = -y0
            dot = 2.0 * (p0 * y0 + p1 * y1 + p2 * y2)
            bend[0, 0] = 2.0 * p0 * y0 - dot
            bend[0, 1] = p0 * y1 + p1 * y0
            bend[0, 2] = p0 * y2 + p2 * y0
            bend[1, 1] = 2.0 * p1 * y1 - dot
            bend[1, 2] = p1 * y2 + p2 * y1
            bend[2, 2] = 2.0 * p2 * y2 - dot
            for a in range(6):
                weighted[0, a] = b00 * jacobian[0, a] + b01 * jacobian[1, a] + b02 * jacobian[2, a]
                weighted[1, a] = b01 * jacobian[0, a] + b11 * jacobian[1, a] + b12 * jacobian[2, a]
                weighted[2, a] = b02 * jacobian[0, a] + b12 * jacobian[1, a] + b22 * jacobian[2, a]
            terms[0] += score
            k = 7
            for a in range(6):
                terms[1 + a] += slope * gradient[a]
                for b in range(a, 6):
                    convex = (
                        2.0
                        * slope
                        * (
                            jacobian[0, a] * weighted[0, b]
                            + jacobian[1, a] * weighted[1, b]
                            + jacobian[2, a] * weighted[2, b]
                        )
                    )
                    exact = convex + curve * gradient[a] * gradient[b]
                    if a >= 3:
                        exact += slope * bend[a - 3, b - 3]
                    terms[k] += exact
                    terms[k + 21] += convex
                    k += 1
    return terms
