"""What is compared: scanlock's methods, and peers where they are installed."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scanlock.geometry.pose import Pose
from scanlock.registration.methods import METHODS
from scanlock.registration.register import register

Cloud = NDArray[np.float64]

SUCCESS_METRES = 0.3
SUCCESS_DEGREES = 1.0


@dataclass(frozen=True)
class Contender:
    """Raw arrays and a start in; a pose, and whether it claims to be right, out."""

    name: str
    register: Callable[[Cloud, Cloud, Pose], tuple[Pose, bool]]


def ours(method: str) -> Contender:
    def run(source: Cloud, target: Cloud, start: Pose) -> tuple[Pose, bool]:
        result = register(source=source, target=target, method=method, initial=start)
        return result.target_from_source, result.ok

    return Contender(f"scanlock {method}", run)


def small_gicp_contender(kind: str, gate: float) -> Contender:
    import small_gicp

    def run(source: Cloud, target: Cloud, start: Pose) -> tuple[Pose, bool]:
        result = small_gicp.align(
            target,
            source,
            init_T_target_source=start.matrix,
            registration_type=kind,
            downsampling_resolution=0.25,
            max_correspondence_distance=gate,
            num_threads=1,
            max_iterations=100,
        )
        # Its step tolerance can leave the matrix a rounding away from a rotation.
        return Pose.from_matrix(result.T_target_source), bool(result.converged)

    return Contender(f"small_gicp {kind}, {gate:g} m", run)


def contenders(peers: bool) -> list[Contender]:
    found = [ours(method) for method in METHODS]
    if peers:
        found += [
            small_gicp_contender("GICP", 1.0),
            small_gicp_contender("GICP", 10.0),
            small_gicp_contender("VGICP", 1.0),
        ]
    return found


def pose_error(pose: Pose, truth: Pose) -> tuple[float, float]:
    """Return the error in metres and degrees."""
    metres, radians = pose.distance(truth)
    return metres, math.degrees(radians)


def is_solved(error: tuple[float, float]) -> bool:
    return error[0] <= SUCCESS_METRES and error[1] <= SUCCESS_DEGREES
