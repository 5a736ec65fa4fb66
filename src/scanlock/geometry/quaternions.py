"""Poses from a translation and a unit quaternion."""

import math
from collections.abc import Sequence

import numpy as np

from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose

_NORM_TOLERANCE = 1e-2
"""Maximum deviation of the norm of a quaternion from 1; few printed digits cause some."""


def pose_from_quaternion(translation: Sequence[float], quaternion: Sequence[float]) -> Pose:
    """Return the pose of a translation and a unit quaternion.

    Parameters
    ----------
    translation : (3,) [m]
    quaternion : (4,)
        In the order (w, x, y, z); it is normalised.

    Raises
    ------
    InvalidInput
        The norm of the quaternion is not 1, or a number is not finite.
    """
    q = np.asarray(quaternion, dtype=np.float64)
    norm = math.hypot(*q)
    if not abs(norm - 1.0) <= _NORM_TOLERANCE:
        raise InvalidInput(f"quaternion must have norm 1, got {norm:.6g} for {list(quaternion)}")
    w, x, y, z = q / norm
    # fmt: off
    rotation = np.array([
        [1 - 2 * (y * y + z * z),     2 * (x * y - w * z),     2 * (x * z + w * y)],
        [    2 * (x * y + w * z), 1 - 2 * (x * x + z * z),     2 * (y * z - w * x)],
        [    2 * (x * z - w * y),     2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])
    # fmt: on
    return Pose(rotation, np.asarray(translation, dtype=np.float64))
