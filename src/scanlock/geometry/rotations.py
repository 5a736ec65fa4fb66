"""Rotation matrices, their exponentials and logarithms, and quaternions."""

import math

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Matrix, Points, Vector, frozen

_SMALL_ANGLE = 1e-4
"""Below this angle [rad] the series of sin(a)/a and (1-cos a)/a^2 are exact to rounding."""

_IDENTITY = np.eye(3)
frozen(_IDENTITY)


def hat(vector: Vector) -> Matrix:
    """Return the (3, 3) skew-symmetric matrix with ``hat(a) @ b == cross(a, b)``."""
    x, y, z = vector.tolist()  # Python's floats are negated faster than NumPy's.
    # fmt: off
    return np.array([[0.0,  -z,   y],
                     [  z, 0.0,  -x],
                     [ -y,   x, 0.0]])
    # fmt: on


def hats(vectors: Points) -> NDArray[np.float64]:
    """Return the (n, 3, 3) skew-symmetric matrices of (n, 3) vectors; see `hat`."""
    upper = np.zeros((len(vectors), 3, 3))
    x, y, z = vectors.T
    upper[:, 0, 1], upper[:, 0, 2], upper[:, 1, 2] = -z, y, -x
    return upper - upper.transpose(0, 2, 1)


def exp_rotation(phi: Vector) -> Matrix:
    """Return the rotation by the angle ``|phi|`` [rad] about the axis ``phi`` (Rodrigues)."""
    # NumPy's norm, sine and matmul take three times as long for three numbers.
    angle = math.sqrt(float(phi @ phi))
    if angle < _SMALL_ANGLE:
        sine_ratio = 1.0 - angle**2 / 6.0
        cosine_ratio = 0.5 - angle**2 / 24.0
    else:
        sine_ratio = math.sin(angle) / angle
        # The half-angle form keeps the digits that 1 - cos(a) loses at small angles.
        cosine_ratio = 0.5 * (math.sin(angle / 2) / (angle / 2)) ** 2
    generator = hat(phi)
    return _IDENTITY + sine_ratio * generator + (cosine_ratio * generator).dot(generator)


def log_rotation(rotation: Matrix) -> Vector:
    """Return the rotation vector (axis times angle in [0, pi]) [rad]; inverse of `exp_rotation`.

    Computed from the unit quaternion, which is accurate at angles near pi too.
    """
    quaternion = quaternion_from_rotation(rotation)
    scalar, vector = float(quaternion[0]), quaternion[1:]
    sine = math.sqrt(float(vector.dot(vector)))
    if sine < _SMALL_ANGLE:
        return vector * (2.0 / scalar) * (1.0 - (sine / scalar) ** 2 / 3.0)
    return vector * (2.0 * math.atan2(sine, scalar) / sine)


def inverse_left_jacobian(phi: Vector) -> Matrix:
    """Return J with ``log(exp(d) exp(phi)) = phi + J d`` to first order in a small ``d``.

    Singular at ``|phi| = 2 pi``; `log_rotation` returns angles of at most pi.
    """
    angle = float(np.linalg.norm(phi))
    if angle < _SMALL_ANGLE:
        ratio = 1.0 / 12.0 + angle**2 / 720.0
    else:
        ratio = 1.0 / angle**2 - 0.5 / (angle * np.tan(0.5 * angle))
    generator = hat(phi)
    return np.eye(3) - 0.5 * generator + ratio * generator @ generator


def rotation_angle(rotation: Matrix) -> float:
    """Return the angle [rad] of a rotation, in [0, pi] and accurate at both ends."""
    return float(np.linalg.norm(log_rotation(rotation)))


def quaternion_from_rotation(rotation: Matrix) -> Vector:
    """Return the unit quaternion (w, x, y, z), w >= 0, of a rotation (Shepperd's method)."""
    r = rotation.tolist()
    trace = r[0][0] + r[1][1] + r[2][2]
    largest = max(range(3), key=lambda axis: r[axis][axis])
    if trace >= r[largest][largest]:
        q = np.array(
            [1.0 + trace, r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]], np.float64
        )
    else:
        i, j, k = largest, (largest + 1) % 3, (largest + 2) % 3
        q = np.empty(4)
        q[0] = r[k][j] - r[j][k]
        q[1 + i] = 1.0 + r[i][i] - r[j][j] - r[k][k]
        q[1 + j] = r[j][i] + r[i][j]
        q[1 + k] = r[k][i] + r[i][k]
    q /= math.sqrt(float(q.dot(q)))
    return -q if q[0] < 0 else q


def nearest_rotation(matrix: Matrix) -> Matrix:
    """Return the rotation closest to a 3x3 matrix in the Frobenius norm (SVD, det = +1)."""
    u, _, vt = np.linalg.svd(matrix)
    u[:, -1] *= np.sign(np.linalg.det(u @ vt))
    return u @ vt


def rotation_onto_z(direction: Vector) -> Matrix:
    """Return a rotation that maps a unit vector to the z axis.

    For an upward vector it is the smallest one. For a downward one, half a turn about the x axis
    comes first: the smallest rotation is not unique at -z, and inaccurate nearby.
    """
    x, y, z = direction
    if z < 0.0:
        half_turn = np.array([1.0, -1.0, -1.0])
        return rotation_onto_z(half_turn * direction) * half_turn
    scale = 1.0 / (1.0 + z)
    # fmt: off
    return np.array([[1.0 - scale * x * x,      -scale * x * y,  -x],
                     [     -scale * x * y, 1.0 - scale * y * y,  -y],
                     [                  x,                   y,   z]])
    # fmt: on
