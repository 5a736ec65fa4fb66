"""Screw motion: poses of a frame with constant velocity, as of a sensor during a sweep.

A twist is the velocity ``(v, omega)`` [m/s, rad/s] in the moving frame, translation first. With a
constant twist, ``world_from_frame(t) = world_from_frame(0) @ exp(t * twist)``.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scanlock.arrays import Matrix, Vector
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import hat, log_rotation

_MIN_RATE = 1e-9
"""Rotation rate [rad/s] below which a screw is a straight line up to rounding, for minutes."""


def screw(twist: Vector, times: Vector) -> tuple[NDArray[np.float64], Matrix]:
    """Compute the motions ``exp(t * twist)``.

    Parameters
    ----------
    twist : (6,) [m/s, rad/s]
        Translation first.
    times : (n,) [s]
        Of either sign.

    Returns
    -------
    rotations : (n, 3, 3)
    translations : (n, 3) [m]
    """
    velocity, omega = twist[:3], twist[3:]
    t = np.asarray(times, np.float64)[:, None]
    rate = float(np.linalg.norm(omega))
    if rate < _MIN_RATE:
        rotations = np.eye(3) + t[:, :, None] * hat(omega)
        return rotations, t * velocity
    axis = hat(omega / rate)
    square = axis @ axis
    angle = rate * t
    sine = np.sin(angle)
    # Half-angle form of 1 - cos(a), which loses no digits for small angles.
    versine = 2.0 * np.sin(0.5 * angle) ** 2
    rotations = np.eye(3) + sine[:, :, None] * axis + versine[:, :, None] * square
    translations = (
        t * velocity
        + versine / rate * (axis @ velocity)
        + (angle - sine) / rate * (square @ velocity)
    )
    return rotations, translations


def checked_twist(twist: ArrayLike | None) -> Vector:
    """Return a twist as (6,) float64, zero for None.

    Raises
    ------
    InvalidInput
        Another shape, or numbers that are not finite.
    """
    checked = np.zeros(6) if twist is None else np.array(twist, np.float64)
    if checked.shape != (6,) or not np.isfinite(checked).all():
        raise InvalidInput(f"twist must be six finite numbers, got {checked.tolist()}")
    return checked


def carried(pose: Pose, twist: Vector, time: float) -> Pose:
    """Return the pose of a frame after a motion with a constant twist.

    Parameters
    ----------
    pose : Pose
        ``world_from_frame`` before the motion.
    twist : (6,) [m/s, rad/s]
        Translation first.
    time : float [s]
        Duration of the motion, of either sign.

    Returns
    -------
    Pose
        ``world_from_frame`` after the motion.
    """
    rotations, translations = screw(twist, np.array([time]))
    return pose @ Pose(rotations[0], translations[0])


def twist_between(before: Pose, after: Pose, seconds: float) -> Vector:
    """Return the constant twist of the motion between two poses.

    Parameters
    ----------
    before, after : Pose
        ``world_from_frame`` before and after the motion.
    seconds : float [s]
        Duration of the motion.

    Returns
    -------
    (6,) [m/s, rad/s]
        Translation first.
    """
    step = before.inverse() @ after
    omega = log_rotation(step.rotation) / seconds
    # The translation of a screw is linear in its velocity.
    columns = [
        screw(np.concatenate([unit, omega]), np.array([seconds]))[1][0] for unit in np.eye(3)
    ]
    velocity = np.linalg.solve(np.column_stack(columns), step.translation)
    return np.concatenate([velocity, omega]).astype(np.float64)
