"""What is compared: raw arrays in, a pose and a claim out; and when a pose is right."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scanlock.geometry.pose import Pose
from scanlock.registration.register import register
from scanlock.registration.registry import METHODS

Cloud = NDArray[np.float64]

SUCCESS_METRES = 0.3
SUCCESS_DEGREES = 1.0

Claimed = tuple[Pose, bool | None]
"""A pose, and whether it claims to be right.

None for a peer that claims nothing: Open3D gives a fitness and leaves its limit to the user.
"""


@dataclass(frozen=True)
class Contender:
    """Source, target and a start in; who needs no start is given None."""

    name: str
    register: Callable[[Cloud, Cloud, Pose | None], Claimed]


def ours(name: str, method: Any = None, threads: int = 1) -> Contender:
    """Return a method of scanlock by its name, or settings under a name of their own."""
    chosen = METHODS[name] if method is None else method

    def run(source: Cloud, target: Cloud, start: Pose | None) -> Claimed:
        result = register(
            source=source, target=target, method=chosen, initial=start, threads=threads
        )
        return result.target_from_source, result.ok

    return Contender(f"scanlock {name}", run)


def pose_error(pose: Pose, truth: Pose) -> tuple[float, float]:
    """Return the error in metres and degrees."""
    metres, radians = pose.distance(truth)
    return metres, math.degrees(radians)


def is_solved(error: tuple[float, float]) -> bool:
    return error[0] <= SUCCESS_METRES and error[1] <= SUCCESS_DEGREES
