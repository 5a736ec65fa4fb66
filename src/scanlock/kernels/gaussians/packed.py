"""Symmetric matrices as (k, 6) packed upper triangles xx, xy, xz, yy, yz, zz."""

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector
from scanlock.kernels._compile import sum_kernel


@sum_kernel
def packed_inverses(packed: Matrix) -> Matrix:
    """Return the inverses of (k, 6) packed matrices; infinities or NaN where there is none."""
    inverses = np.empty(packed.shape, np.float64)
    for k in range(packed.shape[0]):
        xx, xy, xz = packed[k, 0], packed[k, 1], packed[k, 2]
        yy, yz, zz = packed[k, 3], packed[k, 4], packed[k, 5]
        a = yy * zz - yz * yz
        b = xz * yz - xy * zz
        c = xy * yz - xz * yy
        scale = 1.0 / (xx * a + xy * b + xz * c)
        inverses[k, 0] = scale * a
        inverses[k, 1] = scale * b
        inverses[k, 2] = scale * c
        inverses[k, 3] = scale * (xx * zz - xz * xz)
        inverses[k, 4] = scale * (xy * xz - xx * yz)
        inverses[k, 5] = scale * (xx * yy - xy * xy)
    return inverses


@sum_kernel
def packed_turned(packed: Matrix, rotation: Matrix) -> Matrix:
    """Return ``R C R'`` of each of (k, 6) packed matrices C."""
    r00, r01, r02 = rotation[0, 0], rotation[0, 1], rotation[0, 2]
    r10, r11, r12 = rotation[1, 0], rotation[1, 1], rotation[1, 2]
    r20, r21, r22 = rotation[2, 0], rotation[2, 1], rotation[2, 2]
    turned = np.empty(packed.shape, np.float64)
    for k in range(packed.shape[0]):
        xx, xy, xz = packed[k, 0], packed[k, 1], packed[k, 2]
        yy, yz, zz = packed[k, 3], packed[k, 4], packed[k, 5]
        h00, h01, h02 = (
            r00 * xx + r01 * xy + r02 * xz,
            r00 * xy + r01 * yy + r02 * yz,
            r00 * xz + r01 * yz + r02 * zz,
        )
        h10, h11, h12 = (
            r10 * xx + r11 * xy + r12 * xz,
            r10 * xy + r11 * yy + r12 * yz,
            r10 * xz + r11 * yz + r12 * zz,
        )
        h20, h21, h22 = (
            r20 * xx + r21 * xy + r22 * xz,
            r20 * xy + r21 * yy + r22 * yz,
            r20 * xz + r21 * yz + r22 * zz,
        )
        turned[k, 0] = h00 * r00 + h01 * r01 + h02 * r02
        turned[k, 1] = h00 * r10 + h01 * r11 + h02 * r12
        turned[k, 2] = h00 * r20 + h01 * r21 + h02 * r22
        turned[k, 3] = h10 * r10 + h11 * r11 + h12 * r12
        turned[k, 4] = h10 * r20 + h11 * r21 + h12 * r22
        turned[k, 5] = h20 * r20 + h21 * r21 + h22 * r22
    return turned


@sum_kernel
def merged_moments(
    means: Points, packed: Matrix, weights: Vector, labels: Labels, parts: int
) -> tuple[Points, Matrix, Vector]:
    """Return mean (p, 3), packed covariance (p, 6) and weight (p,) of each part of a mixture.

    Gaussian k, with its weight, belongs to the part ``labels[k]``; every part has one.
    """
    total = np.zeros(parts, np.float64)
    middle = np.zeros((parts, 3), np.float64)
    spread = np.zeros((parts, 6), np.float64)
    for k in range(means.shape[0]):
        part = labels[k]
        total[part] += weights[k]
        for a in range(3):
            middle[part, a] += weights[k] * means[k, a]
    for part in range(parts):
        for a in range(3):
            middle[part, a] /= total[part]
    for k in range(means.shape[0]):
        part = labels[k]
        share = weights[k] / total[part]
        x, y, z = (
            means[k, 0] - middle[part, 0],
            means[k, 1] - middle[part, 1],
            means[k, 2] - middle[part, 2],
        )
        spread[part, 0] += share * (packed[k, 0] + x * x)
        spread[part, 1] += share * (packed[k, 1] + x * y)
        spread[part, 2] += share * (packed[k, 2] + x * z)
        spread[part, 3] += share * (packed[k, 3] + y * y)
        spread[part, 4] += share * (packed[k, 4] + y * z)
        spread[part, 5] += share * (packed[k, 5] + z * z)
    return middle, spread, total
