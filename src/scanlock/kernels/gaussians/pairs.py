"""Pairs of points with covariances: the cost of generalised ICP with its derivatives.

A pair of a target point ``mu`` and a source point, ``y`` in the target's frame, costs half its
squared Mahalanobis distance, ``q' B q / 2`` with ``q = y - mu``. For the step ``(rho, phi)`` and
``b = B q`` the cost has::

    gradient  (b, y x b)
    Hessian   L' B L + blkdiag(0, (b y' + y b') / 2 - (b.y) I)
    with      L = [I, -hat(y)]
"""

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector
from scanlock.kernels._compile import sum_kernel


@sum_kernel
def pair_precisions(
    target_covariances: Matrix,
    source_covariances: Matrix,
    target_rows: Labels,
    source_rows: Labels,
    rotation: Matrix,
) -> Matrix:
    """Return the (m, 6) inverses of ``C_t + R C_s R'``, one for each pair of rows.

    All covariances are packed upper triangles xx, xy, xz, yy, yz, zz.
    """
    r00, r01, r02 = rotation[0, 0], rotation[0, 1], rotation[0, 2]
    r10, r11, r12 = rotation[1, 0], rotation[1, 1], rotation[1, 2]
    r20, r21, r22 = rotation[2, 0], rotation[2, 1], rotation[2, 2]
    precisions = np.empty((target_rows.shape[0], 6))
    for m in range(target_rows.shape[0]):
        i, j = source_rows[m], target_rows[m]
        s0, s1, s2 = source_covariances[i, 0], source_covariances[i, 1], source_covariances[i, 2]
        s3, s4, s5 = source_covariances[i, 3], source_covariances[i, 4], source_covariances[i, 5]
        h00 = r00 * s0 + r01 * s1 + r02 * s2
        h01 = r00 * s1 + r01 * s3 + r02 * s4
        h02 = r00 * s2 + r01 * s4 + r02 * s5
        h10 = r10 * s0 + r11 * s1 + r12 * s2
        h11 = r10 * s1 + r11 * s3 + r12 * s4
        h12 = r10 * s2 + r11 * s4 + r12 * s5
        h20 = r20 * s0 + r21 * s1 + r22 * s2
        h21 = r20 * s1 + r21 * s3 + r22 * s4
        h22 = r20 * s2 + r21 * s4 + r22 * s5
        c00 = target_covariances[j, 0] + h00 * r00 + h01 * r01 + h02 * r02
        c01 = target_covariances[j, 1] + h00 * r10 + h01 * r11 + h02 * r12
        c02 = target_covariances[j, 2] + h00 * r20 + h01 * r21 + h02 * r22
        c11 = target_covariances[j, 3] + h10 * r10 + h11 * r11 + h12 * r12
        c12 = target_covariances[j, 4] + h10 * r20 + h11 * r21 + h12 * r22
        c22 = target_covariances[j, 5] + h20 * r20 + h21 * r21 + h22 * r22
        a00 = c11 * c22 - c12 * c12
        a01 = c02 * c12 - c01 * c22
        a02 = c01 * c12 - c02 * c11
        inverse = 1.0 / (c00 * a00 + c01 * a01 + c02 * a02)
        precisions[m, 0] = a00 * inverse
        precisions[m, 1] = a01 * inverse
        precisions[m, 2] = a02 * inverse
        precisions[m, 3] = (c00 * c22 - c02 * c02) * inverse
        precisions[m, 4] = (c01 * c02 - c00 * c12) * inverse
        precisions[m, 5] = (c00 * c11 - c01 * c01) * inverse
    return precisions


@sum_kernel
def pair_terms(
    target_points: Points,
    source_points: Points,
    precisions: Matrix,
    target_rows: Labels,
    source_rows: Labels,
    rotation: Matrix,
    translation: Vector,
    exact: float,
) -> Vector:
    """Return the 28 sums of the cost over all pairs of rows, each with its precision (m, 6).

    The value, the gradient (6) and the upper triangle of the Hessian, row by row (21); with
    `exact` 0 instead of 1 the Hessian is its convex part ``L' B L``, that of Gauss and Newton.
    """
    terms = np.zeros(28)
    r00, r01, r02 = rotation[0, 0], rotation[0, 1], rotation[0, 2]
    r10, r11, r12 = rotation[1, 0], rotation[1, 1], rotation[1, 2]
    r20, r21, r22 = rotation[2, 0], rotation[2, 1], rotation[2, 2]
    for m in range(target_rows.shape[0]):
        i, j = source_rows[m], target_rows[m]
        x0, x1, x2 = source_points[i, 0], source_points[i, 1], source_points[i, 2]
        y0 = r00 * x0 + r01 * x1 + r02 * x2 + translation[0]
        y1 = r10 * x0 + r11 * x1 + r12 * x2 + translation[1]
        y2 = r20 * x0 + r21 * x1 + r22 * x2 + translation[2]
        q0 = y0 - target_points[j, 0]
        q1 = y1 - target_points[j, 1]
        q2 = y2 - target_points[j, 2]
        k00, k01, k02 = precisions[m, 0], precisions[m, 1], precisions[m, 2]
        k11, k12, k22 = precisions[m, 3], precisions[m, 4], precisions[m, 5]
        b0 = k00 * q0 + k01 * q1 + k02 * q2
        b1 = k01 * q0 + k11 * q1 + k12 * q2
        b2 = k02 * q0 + k12 * q1 + k22 * q2
        # N = B hat(y); L' B L has the blocks B, -N and hat(y)' N.
        n00, n01, n02 = k01 * y2 - k02 * y1, k02 * y0 - k00 * y2, k00 * y1 - k01 * y0
        n10, n11, n12 = k11 * y2 - k12 * y1, k12 * y0 - k01 * y2, k01 * y1 - k11 * y0
        n20, n21, n22 = k12 * y2 - k22 * y1, k22 * y0 - k02 * y2, k02 * y1 - k12 * y0
        half0, half1, half2 = 0.5 * exact * b0, 0.5 * exact * b1, 0.5 * exact * b2
        terms[0] += 0.5 * (b0 * q0 + b1 * q1 + b2 * q2)
        terms[1] += b0
        terms[2] += b1
        terms[3] += b2
        terms[4] += y1 * b2 - y2 * b1
        terms[5] += y2 * b0 - y0 * b2
        terms[6] += y0 * b1 - y1 * b0
        terms[7] += k00
        terms[8] += k01
        terms[9] += k02
        terms[10] -= n00
        terms[11] -= n01
        terms[12] -= n02
        terms[13] += k11
        terms[14] += k12
        terms[15] -= n10
        terms[16] -= n11
        terms[17] -= n12
        terms[18] += k22
        terms[19] -= n20
        terms[20] -= n21
        terms[21] -= n22
        terms[22] += y2 * n10 - y1 * n20 - 2.0 * (half1 * y1 + half2 * y2)
        terms[23] += y2 * n11 - y1 * n21 + half0 * y1 + half1 * y0
        terms[24] += y2 * n12 - y1 * n22 + half0 * y2 + half2 * y0
        terms[25] += y0 * n21 - y2 * n01 - 2.0 * (half0 * y0 + half2 * y2)
        terms[26] += y0 * n22 - y2 * n02 + half1 * y2 + half2 * y1
        terms[27] += y1 * n02 - y0 * n12 - 2.0 * (half0 * y0 + half1 * y1)
    return terms
