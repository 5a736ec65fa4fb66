"""Height differences of the grounds of two scans where they overlap, and sums for a plane."""

import math

import numpy as np

from scanlock.arrays import Matrix, Vector
from scanlock.kernels._compile import kernel, sum_kernel


@kernel
def ground_differences(
    target: Matrix,
    target_cell: float,
    source: Matrix,
    source_cell: float,
    rotation: Matrix,
    translation: Vector,
) -> Matrix:
    """Return the height differences from the ground of the source to that of the target.

    Parameters
    ----------
    target, source : (t, t) and (s, s) [m]
        Ground heights in levelled frames, NaN if unobserved. The z axis of each frame is through
        the middle of its grid.
    target_cell, source_cell : float [m]
        Sides of the cells.
    rotation, translation : (3, 3) and (3,) [m]
        Pose of the source in the frame of the target.

    Returns
    -------
    (3, s * s) [m]
        x and y of each cell of the source relative to the translation, and the height of the
        target minus that of the source; NaN unless both have ground there.
    """
    half_source, half_target = source.shape[0] // 2, target.shape[0] // 2
    differences = np.full((3, source.size), math.nan, np.float64)
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
                differences[0, cell], differences[1, cell] = dx, dy
                differences[2, cell] = target[row, column] - dz - translation[2]
    return differences


@sum_kernel
def plane_sums(differences: Matrix, scale: float) -> tuple[Vector, Vector]:
    """Return unweighted and weighted sums over the cells with a difference d, for a plane fit.

    The first result (6,) has the sums of 1, x, y, x x, x y, y y. The second (9,) has the same
    weighted by ``1 / (1 + (d / scale)^2)^2``, followed by the weighted sums of d, x d, y d.
    `differences` are those of `ground_differences`; `scale` is in metres.
    """
    plain, weighted = np.zeros(6), np.zeros(9)
    for k in range(differences.shape[1]):
        x, y, difference = differences[0, k], differences[1, k], differences[2, k]
        if math.isnan(difference):
            continue
        w = 1.0 / (1.0 + (difference / scale) * (difference / scale))
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
        weighted[6] += w * difference
        weighted[7] += w * x * difference
        weighted[8] += w * y * difference
    return plain, weighted
