"""Registration of two scans: check, prepare, align, verify."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.interrupts import plain_interrupts
from scanlock.optimisation.objectives.constraints import Constraints, DegreesOfFreedom, PosePrior
from scanlock.optimisation.solvers.criteria import StopReason
from scanlock.optimisation.solvers.solution import Solution
from scanlock.registration.local_origins import LocalOrigins
from scanlock.registration.local_units import LocalUnits
from scanlock.registration.methods.protocol import Method
from scanlock.registration.prepare import PreparedScan, Scan, prepared_pair
from scanlock.registration.registry import DEFAULT_METHOD, named_method
from scanlock.registration.result import RegistrationResult
from scanlock.registration.uncertainty.accuracy import PoseAccuracy
from scanlock.registration.uncertainty.covariance_estimator import (
    CovarianceEstimator,
    chosen_estimator,
)
from scanlock.registration.uncertainty.pose_covariance import CovarianceMethod, PoseCovariance
from scanlock.registration.uncertainty.sampling_pattern import SamplingPattern
from scanlock.registration.verification.assessment import Assessment, assess_pose
from scanlock.registration.verification.decision import decide_status
from scanlock.registration.verification.metrics import Metrics
from scanlock.registration.verification.probability import probability
from scanlock.registration.verification.status import Status
from scanlock.threads import using_threads
from scanlock.timing import StageClock

_ROUNDING = 1e-6
"""Correction of an initial rotation from which a note is made: above single-precision rounding."""


@plain_interrupts()
def register(
    *,
    source: Scan,
    target: Scan,
    method: str | Method[Any] | None = None,
    initial: ArrayLike | Pose | None = None,
    dof: DegreesOfFreedom = "xyz+rpy",
    prior: PosePrior | None = None,
    fix_degenerate: bool = False,
    covariance: bool | CovarianceMethod | CovarianceEstimator = True,
    verify: bool = True,
    threads: int = 1,
) -> RegistrationResult:
    """Estimate the pose that maps the source scan onto the target scan.

    Parameters
    ----------
    source, target : (n, 3+) array, object with points, or PreparedScan [m]
        Two scans, each in its sensor's frame with z roughly upwards, or both in one map frame;
        float32 or float64. Columns past the third are ignored, rows with NaN or Inf left out. A
        scan from `prepare` is not prepared again.
    method : str or Method, optional
        A key of `METHODS`, or settings such as ``SgcNdt(...)``. By default the method that
        prepared the scans, or else `DEFAULT_METHOD`.
    initial : (4, 4) array or Pose, optional
        The initial pose, target from source. The default method needs none: it searches all
        headings and positions, and an initial pose is one more hypothesis. Other methods start
        from the identity by default.
    dof : str
        Degrees of freedom that may differ from the initial pose, along and about the target's
        axes: ``"xyz+rpy"`` all, ``"xyz+yaw"`` for levelled scanners, ``"xy+yaw"`` for planar
        motion.
    prior : PosePrior, optional
        A Gaussian prior of the pose, weighted against the scans as one more observation.
    fix_degenerate : bool
        Whether degenerate directions keep the value of the prior, or else of the initial pose;
        one of the two must be given. The status is still ``degenerate``.
    covariance : bool or str or CovarianceEstimator
        Whether and how to estimate ``result.covariance`` and ``result.accuracy``. True or
        ``"sandwich"``: from the scatter between blocks of the scene, a few milliseconds;
        ``"hessian"``: from the curvature at the minimum alone, overconfident; ``"sampled"``: from
        twelve more registrations. False leaves both out.
    verify : bool
        Whether to verify the pose. Without verification the status is ``unverified``.
    threads : int
        Maximum number of threads. The result does not depend on it, to the last bit.

    Returns
    -------
    RegistrationResult
        ``target_from_source`` with a status. Check ``result.ok`` before using the pose.

    Raises
    ------
    InvalidInput
        A scan of the wrong shape or type or without a finite point, an unknown method, a scan
        prepared by another method, an initial pose that is not a rigid motion, or
        ``fix_degenerate`` without verification or without a prior or an initial pose.
    """
    begin = time.perf_counter()
    name, chosen = _method(method, source, target)
    start, notes = _initial_pose(initial)
    if fix_degenerate and prior is None and start is None:
        raise InvalidInput("fix_degenerate needs the pose to keep: give prior or initial")
    if fix_degenerate and not verify:
        raise InvalidInput("fix_degenerate needs the verification: leave out verify=False")
    constraints = Constraints(dof=dof, prior=prior)
    estimator = chosen_estimator(covariance)
    with using_threads(threads):
        call = _Call(name, chosen, source, target, start, constraints, verify)
        call.notes += notes
        if reason := call.insufficient:
            return call.failed(reason, time.perf_counter() - begin)
        solution = call.align()
        assessment = call.assess(solution) if verify and not call.unverifiable else None
        if fix_degenerate and assessment is not None and assessment.degenerate:
            solution, assessment = call.fix_degenerate(solution, assessment)
        found = None if estimator is None else call.covariance(solution, estimator)
    return call.result(solution, assessment, found, time.perf_counter() - begin)


class _Call:
    """One call of `register`: two prepared scans, and the transforms between their frames."""

    def __init__(
        self,
        name: str,
        method: Method[Any],
        source: Scan,
        target: Scan,
        initial: Pose | None,
        constraints: Constraints,
        verify: bool,
    ) -> None:
        self.name, self.method, self.initial = name, method, initial
        self.clock = StageClock()
        self.target, self.source = prepared_pair(target, source, method, verify, self.clock)
        self.units = LocalUnits(self.target.length_scale)
        self.notes = [
            f"{role}: {note}"
            for role, scan in (("target", self.target), ("source", self.source))
            for note in scan.notes
        ]
        self.origins = LocalOrigins.of_clouds(self.target.cloud, self.source.cloud)
        prior = constraints.prior
        if prior is not None:
            prior = PosePrior(self.origins.local(prior.pose), prior.covariance)
            prior = self.units.prior_from_metres(prior)
        self.constraints = replace(constraints, prior=prior)

    @property
    def insufficient(self) -> str:
        """Why the scans cannot be registered; empty if they can."""
        for role, scan in (("target", self.target), ("source", self.source)):
            if scan.insufficient:
                return f"the {role} {scan.insufficient}"
        return ""

    @property
    def start(self) -> Pose:
        """The initial pose between the local frames, in their units."""
        return self.units.from_metres(self.origins.local(self.initial or Pose.identity()))

    def align(self) -> Solution:
        """Run the method."""
        # Map coordinates give the relative position of the scans, as an initial pose does.
        is_on_map = bool(self.target.cloud.origin.any() or self.source.cloud.origin.any())
        start = self.start if self.initial is not None or is_on_map else None
        with self.clock.stage("align"):
            return self._aligned(start)

    def _aligned(self, start: Pose | None) -> Solution:
        return self.method.align(self.target.data, self.source.data, start, self.constraints)

    @property
    def unverifiable(self) -> str:
        """Why the pose cannot be verified; empty if it can."""
        for role, scan in (("target", self.target), ("source", self.source)):
            if scan.unverifiable:
                return f"the {role} {scan.unverifiable}"
        return ""

    def assess(self, solution: Solution) -> Assessment:
        """Assess the pose of a solution by both scans, neither of them unverifiable."""
        target, source = self.target.features, self.source.features
        assert target is not None
        assert source is not None
        with self.clock.stage("verification"):
            return assess_pose(
                target, source, solution.pose, solution.candidates, solution.runner_up_ratio
            )

    def fix_degenerate(
        self, solution: Solution, assessment: Assessment
    ) -> tuple[Solution, Assessment]:
        """Replace degenerate directions by those of the prior or the initial pose."""
        prior = self.constraints.prior
        at = "initial pose" if prior is None else "prior"
        self.notes += [f"{one.name} fixed at the {at}" for one in assessment.degenerate]
        known = self.start if prior is None else prior.pose
        fixed = replace(solution, pose=assessment.fix_degenerate(solution.pose, known))
        # The candidates were scored at other poses.
        return fixed, self.assess(replace(fixed, candidates=(), runner_up_ratio=math.nan))

    def covariance(
        self, solution: Solution, estimator: CovarianceEstimator
    ) -> PoseCovariance | None:
        """Estimate the covariance of the pose, or note why there is none."""
        with self.clock.stage("covariance"):
            factor = solution.covariance_factor
            if factor is None:
                factor = self.method.covariance_factor
            pattern = None if estimator.method == "hessian" else self._sampling_pattern()
            found = estimator.estimate(solution, factor, self._aligned, pattern)
        if isinstance(found, str):
            self.notes.append(f"no covariance: {found}")
            return None
        pose = self.origins.caller(self.units.to_metres(solution.pose))
        point = self.origins.source_origin
        return PoseCovariance(
            matrix=self.units.covariance_to_metres(found[0]),
            pose=pose,
            reference_point=point,
            method=estimator.method,
            blocks=found[1],
        )

    def _sampling_pattern(self) -> SamplingPattern | None:
        """Measure the sampling pattern of the target; None if its origin may not be the sensor."""
        cloud = self.target.cloud
        if cloud.origin.any() or cloud.takes_sparse_settings:
            return None
        return SamplingPattern.of_points(cloud.measured_points)

    def result(
        self,
        solution: Solution,
        assessment: Assessment | None,
        covariance: PoseCovariance | None,
        seconds: float,
    ) -> RegistrationResult:
        """Return the result in the caller's frames."""
        if assessment is None:
            right = math.nan
            status, reason = _unverified(solution.reason, self.unverifiable)
        else:
            right = probability(assessment.metrics, assessment.directions)
            assessment = self.units.assessment_to_metres(assessment)
            status, reason = decide_status(solution, assessment, right, self.units.scale)
        solution = self.units.solution_to_metres(solution)
        caller = self.origins.caller
        return RegistrationResult(
            target_from_source=caller(solution.pose),
            status=status,
            reason=reason,
            method=self.name,
            metrics=Metrics() if assessment is None else assessment.metrics,
            probability=right,
            directions=() if assessment is None else assessment.directions,
            converged=solution.reason.is_converged,
            hessian=solution.quadratic.hessian,
            history=solution.history,
            timings={**self.clock.seconds, "total": seconds},
            notes=(*self.notes, *map(str, solution.notes)),
            candidates=tuple(
                one.with_pose(caller(one.target_from_source)) for one in solution.candidates
            ),
            covariance=covariance,
            accuracy=None if covariance is None else self._accuracy(covariance, assessment),
            origins=self.origins,
            length_scale=self.units.scale,
        )

    def _accuracy(self, covariance: PoseCovariance, assessment: Assessment | None) -> PoseAccuracy:
        """Return the accuracy at the centroid of the overlap, or of the source if it is unknown."""
        centroid = None if assessment is None else assessment.overlap_centroid
        point = self.origins.source_centroid
        if centroid is not None:
            in_target = centroid + self.origins.target_origin
            point = covariance.pose.inverse().apply(in_target)
        return PoseAccuracy.of(covariance, point, "map" if self.origins.is_on_map else "sensor")

    def failed(self, reason: str, seconds: float) -> RegistrationResult:
        """Return the result for scans that cannot be registered."""
        return RegistrationResult(
            target_from_source=self.initial or Pose.identity(),
            status=Status.NO_CORRESPONDENCES,
            reason=reason,
            method=self.name,
            timings={**self.clock.seconds, "total": seconds},
            notes=tuple(self.notes),
            origins=self.origins,
            length_scale=self.units.scale,
        )


def _method(
    method: str | Method[Any] | None, source: Scan, target: Scan
) -> tuple[str, Method[Any]]:
    """Return the method that was asked for, or the one that prepared the scans."""
    prepared = [scan for scan in (source, target) if isinstance(scan, PreparedScan)]
    if method is None and prepared:
        name, chosen = prepared[0].method_name, prepared[0].method
    else:
        name, chosen = named_method(DEFAULT_METHOD if method is None else method)
    for scan in prepared:
        if scan.method != chosen:
            raise InvalidInput(
                f"method must be the one that prepared the scan ({scan.method_name}), got {name}; "
                "prepare it again for another method"
            )
    return name, chosen


def _initial_pose(initial: ArrayLike | Pose | None) -> tuple[Pose | None, list[str]]:
    """Return the initial pose, and a note if its rotation had to be corrected."""
    if initial is None or isinstance(initial, Pose):
        return initial, []
    pose = Pose.from_matrix(initial, "initial")
    difference = float(np.abs(pose.matrix[:3, :3] - np.asarray(initial)[:3, :3]).max())
    if difference < _ROUNDING:
        return pose, []
    return pose, [
        f"initial: its 3x3 part was {difference:.1e} away from a rotation; the nearest was used"
    ]


def _unverified(reason: StopReason, unverifiable: str) -> tuple[Status, str]:
    """Return status and reason of a pose that was not verified."""
    if reason is StopReason.EMPTY_OBJECTIVE:
        return Status.NO_CORRESPONDENCES, reason.value
    if not reason.is_converged:
        return Status.NOT_CONVERGED, reason.value
    if unverifiable:
        return Status.UNVERIFIED, f"the pose cannot be verified: {unverifiable}; look at the scans"
    return Status.UNVERIFIED, f"{reason.value}; the pose was not verified (verify=False)"
