"""Sum of the distribution-to-distribution score over all pairs of Gaussians.

With ``y = R m + t`` the mean of a source Gaussian in the target frame, ``C = R C_s R'`` its
covariance there, ``q = y - mu``, ``B = (C + C_t)^-1``, ``b = B q`` and ``u = y - C b``, the
squared distance ``s = q' B q`` has, for the step ``(rho, phi)``::

    gradient  2 (b, u x b)
    Hessian   2 L' B L + blkdiag(0, b u' + u b' - 2 (b.u) I + 2 hat(b) C hat(b))
    with      L = [I, -(hat(u) + C hat(b))]

which is Stoyanov et al. 2012 in a left perturbation, the turning covariance included.
"""

import math

import numpy as np

from scanlock.arrays import Matrix, Points, Vector
from scanlock.kernels._compile import kernel


@kernel
def d2d_terms(
    target_means: Points,
    target_covariances: Matrix,
    target_widths: Vector,
    target_weights: Vector,
    source_means: Points,
    source_covariances: Matrix,
    source_widths: Vector,
    source_weights: Vector,
    rotation: Matrix,
    translation: Vector,
    sharpness: float,
    window_start: float,
    window_end: float,
) -> Vector:
    """Return value, gradient (6), upper triangle of the Hessian (21), its convex part (21).

    The score of a pair is ``-w exp(-sharpness s / 2) W(s)`` with the window W falling from 1 at
    `window_start` to 0 at `window_end`, twice continuously differentiable. Widths are the
    largest variances: ``s >= |q|^2 / (sum of widths)`` whatever the rotation, so a pair beyond
    the window is skipped before its matrix is inverted. The convex part leaves out all that
    can make the Hessian indefinite.
    """
    terms = np.zeros(49)
    gradient = np.empty(6)
    lever = np.empty((3, 3))
    weighted = np.empty((3, 6))
    jacobian = np.zeros((3, 6))
    bend = np.empty((3, 3))
    jacobian[0, 0] = 1.0
    jacobian[1, 1] = 1.0
    jacobian[2, 2] = 1.0
    span = window_end - window_start
    r00, r01, r02 = rotation[0, 0], rotation[0, 1], rotation[0, 2]
    r10, r11, r12 = rotation[1, 0], rotation[1, 1], rotation[1, 2]
    r20, r21, r22 = rotation[2, 0], rotation[2, 1], rotation[2, 2]

    for i in range(source_means.shape[0]):
        m0, m1, m2 = source_means[i, 0], source_means[i, 1], source_means[i, 2]
        y0 = r00 * m0 + r01 * m1 + r02 * m2 + translation[0]
        y1 = r10 * m0 + r11 * m1 + r12 * m2 + translation[1]
        y2 = r20 * m0 + r21 * m1 + r22 * m2 + translation[2]
        # C = R C_s R', first the half product.
        k0, k1, k2 = source_covariances[i, 0], source_covariances[i, 1], source_covariances[i, 2]
        k3, k4, k5 = source_covariances[i, 3], source_covariances[i, 4], source_covariances[i, 5]
        h00 = r00 * k0 + r01 * k1 + r02 * k2
        h01 = r00 * k1 + r01 * k3 + r02 * k4
        h02 = r00 * k2 + r01 * k4 + r02 * k5
        h10 = r10 * k0 + r11 * k1 + r12 * k2
        h11 = r10 * k1 + r11 * k3 + r12 * k4
        h12 = r10 * k2 + r11 * k4 + r12 * k5
        h20 = r20 * k0 + r21 * k1 + r22 * k2
        h21 = r20 * k1 + r21 * k3 + r22 * k4
        h22 = r20 * k2 + r21 * k4 + r22 * k5
        c00 = h00 * r00 + h01 * r01 + h02 * r02
        c01 = h00 * r10 + h01 * r11 + h02 * r12
        c02 = h00 * r20 + h01 * r21 + h02 * r22
        c11 = h10 * r10 + h11 * r11 + h12 * r12
        c12 = h10 * r20 + h11 * r21 + h12 * r22
        c22 = h20 * r20 + h21 * r21 + h22 * r22

        for j in range(target_means.shape[0]):
            q0 = y0 - target_means[j, 0]
            q1 = y1 - target_means[j, 1]
            q2 = y2 - target_means[j, 2]
            reach = window_end * (source_widths[i] + target_widths[j])
            if q0 * q0 + q1 * q1 + q2 * q2 >= reach:
                continue
            s00 = c00 + target_covariances[j, 0]
            s01 = c01 + target_covariances[j, 1]
            s02 = c02 + target_covariances[j, 2]
            s11 = c11 + target_covariances[j, 3]
            s12 = c12 + target_covariances[j, 4]
            s22 = c22 + target_covariances[j, 5]
            a00 = s11 * s22 - s12 * s12
            a01 = s02 * s12 - s01 * s22
            a02 = s01 * s12 - s02 * s11
            inverse = 1.0 / (s00 * a00 + s01 * a01 + s02 * a02)
            b00 = a00 * inverse
            b01 = a01 * inverse
            b02 = a02 * inverse
            b11 = (s00 * s22 - s02 * s02) * inverse
            b12 = (s01 * s02 - s00 * s12) * inverse
            b22 = (s00 * s11 - s01 * s01) * inverse
            p0 = b00 * q0 + b01 * q1 + b02 * q2
            p1 = b01 * q0 + b11 * q1 + b12 * q2
            p2 = b02 * q0 + b12 * q1 + b22 * q2
            squared = p0 * q0 + p1 * q1 + p2 * q2
            if squared >= window_end:
                continue

            # Score of the pair and its first two derivatives in s.
            score = -source_weights[i] * target_weights[j] * math.exp(-0.5 * sharpness * squared)
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

            # e = C b and u = y - e.
            e0 = c00 * p0 + c01 * p1 + c02 * p2
            e1 = c01 * p0 + c11 * p1 + c12 * p2
            e2 = c02 * p0 + c12 * p1 + c22 * p2
            u0 = y0 - e0
            u1 = y1 - e1
            u2 = y2 - e2
            gradient[0] = 2.0 * p0
            gradient[1] = 2.0 * p1
            gradient[2] = 2.0 * p2
            gradient[3] = 2.0 * (u1 * p2 - u2 * p1)
            gradient[4] = 2.0 * (u2 * p0 - u0 * p2)
            gradient[5] = 2.0 * (u0 * p1 - u1 * p0)

            # lever = C hat(b); L's right half is -(hat(u) + lever).
            lever[0, 0] = c01 * p2 - c02 * p1
            lever[0, 1] = c02 * p0 - c00 * p2
            lever[0, 2] = c00 * p1 - c01 * p0
            lever[1, 0] = c11 * p2 - c12 * p1
            lever[1, 1] = c12 * p0 - c01 * p2
            lever[1, 2] = c01 * p1 - c11 * p0
            lever[2, 0] = c12 * p2 - c22 * p1
            lever[2, 1] = c22 * p0 - c02 * p2
            lever[2, 2] = c02 * p1 - c12 * p0
            jacobian[0, 3] = -lever[0, 0]
            jacobian[0, 4] = u2 - lever[0, 1]
            jacobian[0, 5] = -u1 - lever[0, 2]
            jacobian[1, 3] = -u2 - lever[1, 0]
            jacobian[1, 4] = -lever[1, 1]
            jacobian[1, 5] = u0 - lever[1, 2]
            jacobian[2, 3] = u1 - lever[2, 0]
            jacobian[2, 4] = -u0 - lever[2, 1]
            jacobian[2, 5] = -lever[2, 2]
            # bend = b u' + u b' - 2 (b.u) I + 2 hat(b) lever, upper triangle.
            dot = 2.0 * (p0 * u0 + p1 * u1 + p2 * u2)
            bend[0, 0] = 2.0 * p0 * u0 - dot + 2.0 * (p1 * lever[2, 0] - p2 * lever[1, 0])
            bend[0, 1] = p0 * u1 + p1 * u0 + 2.0 * (p1 * lever[2, 1] - p2 * lever[1, 1])
            bend[0, 2] = p0 * u2 + p2 * u0 + 2.0 * (p1 * lever[2, 2] - p2 * lever[1, 2])
            bend[1, 1] = 2.0 * p1 * u1 - dot + 2.0 * (p2 * lever[0, 1] - p0 * lever[2, 1])
            bend[1, 2] = p1 * u2 + p2 * u1 + 2.0 * (p2 * lever[0, 2] - p0 * lever[2, 2])
            bend[2, 2] = 2.0 * p2 * u2 - dot + 2.0 * (p0 * lever[1, 2] - p1 * lever[0, 2])

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
