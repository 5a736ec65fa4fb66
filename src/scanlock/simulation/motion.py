"""Poses along a constant velocity, as a spinning sensor has them during one sweep.

A twist is the velocity ``(v, omega)`` [m/s, rad/s] in the moving frame itself, translation
first. A frame that keeps its twist moves along a screw:
``world_from_frame(t) = world_from_frame(0) @ exp(t * twist)``.
"""

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Matrix, Vector
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import hat, log_rotation

_SMALL_TURN = 1e-9
"""Below this rate [rad/s] a screw is a straight line to rounding, over minutes."""


def screw(twist: Vector, times: Vector) -> tuple[NDArray[np.float64], Matrix]:
    """Return rotations (n, 3, 3) and translations (n, 3) [m] of ``exp(t * twist)``.

    Parameters
    ----------
    twist : (6,) [m/s, rad/s]
        Translation first.
    times : (n,) [s]
        Of either sign.
    """
    velocity, turn = twist[:3], twist[3:]
    t = np.asarray(times, np.float64)[:, None]
    rate = float(np.linalg.norm(turn))
    if rate < _SMALL_TURN:
        rotations = np.eye(3) + t[:, :, None] * hat(turn)
        return rotations, t * velocity
    axis = hat(turn / rate)
    square = axis @ axis
    angle = rate * t
    sine = np.sin(angle)
    # 1 - cos(a) loses digits for small angles; the half-angle form does not.
    versine = 2.0 * np.sin(0.5 * angle) ** 2
    rotations = np.eye(3) + sine[:, :, None] * axis + versine[:, :, None] * square
    translations = (
        t * velocity
        + versine / rate * (axis @ velocity)
        + (angle - sine) / rate * (square @ velocity)
    )
    return rotations, translations


def carried(pose: Pose, twist: Vector, time: float) -> Pose:
    """Return where a frame with a constant twist is after `time` [s]."""
    rotations, translations = screw(twist, np.array([time]))
    return pose @ Pose(rotations[0], translations[0])


def twist_between(before: Pose, after: Pose, seconds: float) -> Vector:
    """Return the (6,) twist that carries one pose into another in some seconds."""
    step = before.inverse() @ after
    turn = log_rotation(step.rotation) / seconds
    # The translation of a screw is linear in its velocity.
    columns = [screw(np.concatenate([unit, turn]), np.array([seconds]))[1][0] for unit in np.eye(3)]
    velocity = np.linalg.solve(np.column_stack(columns), step.translation)
    return np.concatenate([velocity, turn]).astype(np.float64)
