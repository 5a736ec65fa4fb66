"""Ground that two scans both saw from above, and the plane through the gap between them."""

import math

import numpy as np

from scanlock.arrays import Matrix, Vector
from scanlock.kernels._compile import kernel, sum_kernel


@kernel
def ground_gaps(
    target: Matrix,
    target_cell: float,
    source: Matrix,
    source_cell: float,
    rotation: Matrix,
    translation: Vector,
) -> Matrix:
    """Return how the ground of the target lies over that of the source, cell by cell.

    Grids hold level heights [m], NaN where no ground was seen, about the axis through their
    middle; rotation and translation [m] carry the source into the frame of the target.

    Returns
    -------
    gaps : (3, s * s) [m]
        Where each cell of the source lies, x and y from the translation, and how much higher
        the target is there; NaN where only one of them shows ground.
    """
    half_source, half_target = source.shape[0] // 2, target.shape[0] // 2
    gaps = np.full((3, source.size), math.nan, np.float64)
    for i in range(source.shape[0]):
        x = (i - half_source + 0.5) * source_cell
        for j in range(source.shape[1]):
            z = source[i, j]
            if math.isnan(z):
                continue
            y = (j - half_source + 0.5) * source_cell
            dx = rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z
            dy = rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z
            dz = rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z
            row = math.floor((dx + translation[0]) / target_cell) + half_target
            column = math.floor((dy + translation[1]) / target_cell) + half_target
            if 0 <= row < target.shape[0] and 0 <= column < target.shape[1]:
                cell = i * source.shape[1] + j
                gaps[0, cell], gaps[1, cell] = dx, dy
                gaps[2, cell] = target[row, column] - dz - translation[2]
    return gaps


@sum_kernel
def plane_sums(gaps: Matrix, scale: float) -> tuple[Vector, Vector]:
    """Return sums over the cells with a gap, of `ground_gaps`, plain and weighted.

    Plain are the sums of 1, x, y, x x, x y, y y; the weighted ones are followed by those of the
    gap, x times the gap, y times the gap. A gap of `scale` [m] weighs a quarter of none.
    """
    plain, weighted = np.zeros(6), np.zeros(9)
    for k in range(gaps.shape[1]):
        x, y, gap = gaps[0, k], gaps[1, k], gaps[2, k]
        if math.isnan(gap):
            continue
        w = 1.0 / (1.0 + (gap / scale) * (gap / scale))
        w *= w
        plain[0] += 1.0
        plain[1] += x
        plain[2] += y
        plain[3] += x * x
        plain[4] += x * y
        plain[5] += y * y
        weighted[0] += w
        weighted[1] += w * x
        weighted[2] += w * y
        weighted[3] += w * x * x
        weighted[4] += w * x * y
        weighted[5] += w * y * y
        weighted[6] += w * gap
        weighted[7] += w * x * gap
        weighted[8] += w * y * gap
    return plain, weighted
