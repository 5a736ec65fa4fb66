"""Random starts at given distances from the true pose."""

import math

import numpy as np

from scanlock.geometry.pose import Pose

LEVELS = ((0.5, 2.0), (2.0, 10.0), (4.0, 20.0), (6.0, 30.0), (10.0, 60.0))
"""Distance [m] and angle [deg] of the starts of the basin."""


def random_start(
    truth: Pose, metres: float, degrees: float, axis: str, rng: np.random.Generator
) -> Pose:
    """Return the true pose with a rotation about the target's origin and a translation.

    ``axis`` is "vertical" (vertical axis, nearly horizontal translation) or "random" (both uniform
    on the sphere).
    """
    direction, turn = rng.normal(size=3), rng.normal(size=3)
    if axis == "vertical":
        direction[2] *= 0.1
        turn[:2] = 0.0
    direction *= metres / np.linalg.norm(direction)
    turn *= math.radians(degrees) / np.linalg.norm(turn)
    return Pose.from_step(np.concatenate([direction, turn])) @ truth
