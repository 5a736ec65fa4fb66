"""Contenders of a comparison: functions from two arrays and a start to a pose and a claim."""

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

MAX_METRES = 0.3
MAX_DEGREES = 1.0

PoseAndClaim = tuple[Pose, bool | None]
"""A pose, and whether the library reports it as valid.

None for a library that reports no such thing: Open3D returns a fitness without a threshold.
"""


@dataclass(frozen=True)
class Contender:
    """A registration by name. Arguments: source, target, and a start or None."""

    name: str
    register: Callable[[Cloud, Cloud, Pose | None], PoseAndClaim]


def scanlock_contender(name: str, method: Any = None, threads: int = 1) -> Contender:
    """Return a method of scanlock by its name, or other settings under the given name."""
    chosen = METHODS[name] if method is None else method

    def run(source: Cloud, target: Cloud, start: Pose | None) -> PoseAndClaim:
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
    """Return whether an error is within 0.3 m and 1 degree."""
    return error[0] <= MAX_METRES and error[1] <= MAX_DEGREES
