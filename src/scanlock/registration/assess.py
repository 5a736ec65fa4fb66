"""Verification of a pose from anywhere: another tool, odometry, or a person.

The assessment itself is `scanlock.registration.verification.assessment.assess_pose`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from scanlock.clouds.point_cloud import PointCloud
from scanlock.geometry.pose import Pose
from scanlock.optimisation.objectives.constraints import UNCONSTRAINED, Constraints
from scanlock.optimisation.solvers.criteria import StopReason
from scanlock.optimisation.solvers.problem import Quadratic
from scanlock.optimisation.solvers.solution import Solution
from scanlock.registration.methods.protocol import Method, PreparationLog
from scanlock.registration.prepare import PreparedScan
from scanlock.registration.register import Scan, register
from scanlock.registration.result import RegistrationResult


def assess(
    *, source: Scan, target: Scan, pose: ArrayLike | Pose, threads: int = 1
) -> RegistrationResult:
    """Verify a pose between two scans, whatever tool estimated it.

    The pose is verified as `register` verifies its own, by the scans alone, and returned as it was
    given. No search compares it with other poses: only scores along the directions that constrain
    it least can make it ambiguous.

    Parameters
    ----------
    source, target : (n, 3+) array, PointCloud or PreparedScan [m]
        As for `register`. Scans prepared by any method are taken as they are.
    pose : (4, 4) array or Pose
        Target from source.
    threads : int
        Maximum number of threads.

    Returns
    -------
    RegistrationResult
        With status, probability, metrics and observability of the pose; ``method`` is
        ``"given pose"``.

    Raises
    ------
    InvalidInput
        A scan of the wrong shape or type or without a finite point, or a pose that is not a rigid
        motion.
    """
    method = _GivenPose()
    result = register(
        source=_stripped(source, method),
        target=_stripped(target, method),
        method=method,
        initial=pose,
        covariance=False,
        threads=threads,
    )
    return replace(result, method="given pose", hessian=None, history=())


def _stripped(scan: Scan, method: _GivenPose) -> Scan:
    """Return a prepared scan without the data of its method."""
    if not isinstance(scan, PreparedScan):
        return scan
    if scan.features is None:
        return scan.cloud
    return replace(scan, method=method, method_name="given pose", data=None, insufficient="")


@dataclass(frozen=True, slots=True)
class _GivenPose(Method[None]):
    """The method that returns its initial pose."""

    def prepare(self, cloud: PointCloud, log: PreparationLog | None = None) -> None:
        """Compute nothing."""

    def align(
        self,
        target: None,
        source: None,
        start: Pose | None = None,
        constraints: Constraints = UNCONSTRAINED,
    ) -> Solution:
        """Return the initial pose."""
        empty = Quadratic(0.0, np.zeros(6), np.zeros((6, 6)))
        return Solution(start or Pose.identity(), empty, StopReason.GIVEN, ())
