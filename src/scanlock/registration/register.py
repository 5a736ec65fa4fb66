"""The front door: two scans in, one pose out."""

import time
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.interrupts import plain_interrupts
from scanlock.optimisation.objectives.constraints import Constraints, DegreesOfFreedom, PosePrior
from scanlock.optimisation.solvers.solution import Solution
from scanlock.registration.local_origins import LocalOrigins
from scanlock.registration.methods.calibration import covariance_factor
from scanlock.registration.methods.protocol import Method, Search, SearchResult
from scanlock.registration.prepare import PreparedScan, named_method, prepare
from scanlock.registration.registry import DEFAULT_METHOD
from scanlock.registration.result import RegistrationResult
from scanlock.registration.uncertainty.estimators import CovarianceEstimator
from scanlock.registration.uncertainty.pose_covariance import CovarianceMethod, PoseCovariance
from scanlock.registration.verification.assessment import assess_pose
from scanlock.registration.verification.decision import decide
from scanlock.registration.verification.metrics import Metrics
from scanlock.registration.verification.probability import probability
from scanlock.registration.verification.status import Status
from scanlock.threads import parallel_map, using_threads
from scanlock.timing import StageClock

_MENDED = 1e-6
"""Changes of an initial rotation that are worth a word: more than rounding to single precision."""


@plain_interrupts()
def register(
    source: ArrayLike | PointCloud | PreparedScan,
    target: ArrayLike | PointCloud | PreparedScan,
    *,
    method: str | Method[Any] | None = None,
    initial: ArrayLike | Pose | None = None,
    dof: DegreesOfFreedom = "xyz+rpy",
    prior: PosePrior | None = None,
    fix_degenerate: bool = False,
    covariance: CovarianceMethod | CovarianceEstimator | None = None,
    threads: int = 1,
) -> RegistrationResult:
    """Return the pose that carries the source scan onto the target scan.

    Parameters
    ----------
    source, target : (n, 3+) array, PointCloud or PreparedScan [m]
        Two scans, each in its sensor's frame with z roughly upwards, or both in one map frame;
        float32 or float64. Columns past the third are ignored, rows with NaN or Inf left out.
        The target stays, the source moves (the papers' reference and scene). A scan from
        `prepare` is not prepared again.
    method : str or Method, optional
        A key of `METHODS`, or a method with settings of your own such as ``SgcNdt(...)``. By
        default the one that prepared the scans, or else `DEFAULT_METHOD`.
    initial : (4, 4) array or Pose, optional
        Where to start, target from source. The default method needs none: it searches all
        headings and places, and an initial pose is one more hypothesis. Other methods start from
        the identity without one.
    dof : str
        What may change of the initial pose, along and about the target's axes: ``"xyz+rpy"``
        everything, ``"xyz+yaw"`` for levelled scanners, ``"xy+yaw"`` for a flat world.
    prior : PosePrior, optional
        A Gaussian belief about the pose, weighed against the scans as one more observation.
    hold_weak : bool
        Whether directions that the scans leave open stay as in the prior, or else as in the
        initial pose; one of the two must be given. The status is still ``degenerate``.
    covariance : str or Uncertainty, optional
        How ``result.covariance`` is found: ``"sandwich"`` by the scatter among independent parts of
        the scene, for a few milliseconds; ``"hessian"`` by the curvature at the minimum alone,
        overconfident; ``"sampled"`` by twelve registrations more, from starts around the pose; or
        settings of your own. None leaves it out.
    threads : int
        How many threads may share the work; the result is the same to the last bit. Calls from
        threads or processes of your own need no more than one each.

    Returns
    -------
    Registration
        ``target_from_source`` with a status; look at ``result.ok`` before using the pose.

    Raises
    ------
    InvalidInput
        A scan of the wrong shape or type or without a finite point, an unknown method, a scan
        prepared by another method, an initial pose that is no rigid motion, or weak directions to
        be held without a pose to hold them at.
    """
    begin = time.perf_counter()
    name, chosen = _method(method, source, target)
    start, mended = _start(initial)
    Constraints(dof=dof)
    if fix_degenerate and prior is None and initial is None:
        raise InvalidInput(
            "hold_weak needs a pose to hold weak directions at: give prior or initial"
        )
    uncertainty = (
        CovarianceEstimator(method=covariance) if isinstance(covariance, str) else covariance
    )
    with using_threads(threads):
        prepared = parallel_map(
            lambda side: _ready(*side, chosen), ((target, "target"), (source, "source"))
        )
    clock = StageClock()
    for scan, side in zip((target, source), prepared, strict=True):
        if not isinstance(scan, PreparedScan):
            for stage, seconds in side.timings.items():
                clock.seconds[stage] = clock.seconds.get(stage, 0.0) + seconds
    notes = [
        f"{role}: {note}"
        for role, side in zip(("target", "source"), prepared, strict=True)
        for note in side.notes
    ] + mended
    clouds = prepared[0].cloud, prepared[1].cloud
    frames = LocalOrigins.of_clouds(*clouds)
    shortages = [side.insufficient for side in prepared]
    features = [side.features for side in prepared]
    if any(shortages) or features[0] is None or features[1] is None:
        role = "target" if shortages[0] else "source"
        reason = f"the {role} {shortages[0] or shortages[1]}"
        clock.seconds["total"] = time.perf_counter() - begin
        return RegistrationResult(
            start, Status.NO_CORRESPONDENCES, reason, name, Metrics(), 0.0, (), (), clock.seconds,
            tuple(notes), frames=frames,
        )  # fmt: skip

    with clock.stage("align"):
        constraints = Constraints(dof=dof, prior=_local_prior(prior, frames))
        kept, begins = (prepared[0].data, prepared[1].data), frames.local(start)
        # Coordinates of a map say where the scans lie, as an initial pose does.
        is_placed = initial is not None or any(cloud.origin.any() for cloud in clouds)
        with using_threads(threads):
            if isinstance(chosen, Search):
                found = chosen.find(*kept, begins if is_placed else None, constraints)
            else:
                found = SearchResult(chosen.align(*kept, begins, constraints), ())
        solution = found.solution
    with clock.stage("verdict"):
        both_features = features[0], features[1]
        assessment = assess_pose(*both_features, solution.pose, found.candidates, found.rival)
        if fix_degenerate and assessment.degenerate:
            believed = constraints.prior
            at = "initial pose" if believed is None else "prior"
            notes += [f"{one.name} held at the {at}" for one in assessment.degenerate]
            fixed_at = begins if believed is None else believed.pose
            solution = replace(solution, pose=assessment.fix_degenerate(solution.pose, fixed_at))
            assessment = assess_pose(*both_features, solution.pose)
        probability_right = probability(assessment.metrics, assessment.directions)
        status, reason = decide(solution, assessment, probability_right)
    pose_covariance = None
    if uncertainty is not None:
        with clock.stage("covariance"), using_threads(threads):
            align = partial(_aligned, chosen, kept, constraints)
            covariance_told = uncertainty.estimate(solution, covariance_factor(chosen), align)
        if isinstance(covariance_told, str):
            notes.append(f"no covariance: {covariance_told}")
        else:
            pose, place = frames.caller(solution.pose), frames.source_origin
            pose_covariance = PoseCovariance(
                covariance_told[0], pose, place, uncertainty.method, covariance_told[1]
            )
    clock.seconds["total"] = time.perf_counter() - begin
    return RegistrationResult(
        frames.caller(solution.pose), status, reason, name, assessment.metrics, probability_right,
        assessment.directions, solution.history, clock.seconds, (*notes, *solution.notes),
        tuple(one.at(frames.caller(one.target_from_source)) for one in found.candidates),
        pose_covariance,
        frames,
    )  # fmt: skip


def _aligned(
    method: Method[Any], kept: tuple[Any, Any], constraints: Constraints, start: Pose
) -> Solution:
    return method.align(*kept, start, constraints)


def _method(
    method: str | Method[Any] | None,
    source: ArrayLike | PointCloud | PreparedScan,
    target: ArrayLike | PointCloud | PreparedScan,
) -> tuple[str, Method[Any]]:
    prepared = [scan for scan in (source, target) if isinstance(scan, PreparedScan)]
    if method is not None:
        name, chosen = named_method(method)
    elif prepared:
        name, chosen = prepared[0].method_name, prepared[0].method
    else:
        name, chosen = named_method(DEFAULT_METHOD)
    for scan in prepared:
        if scan.method != chosen:
            raise InvalidInput(
                f"method must be the one that prepared the scan ({scan.method_name}), got {name}; "
                "prepare it again for another method"
            )
    return name, chosen


def _ready(
    scan: ArrayLike | PointCloud | PreparedScan, role: str, method: Method[Any]
) -> PreparedScan:
    return scan if isinstance(scan, PreparedScan) else prepare(scan, method=method, role=role)


def _start(initial: ArrayLike | Pose | None) -> tuple[Pose, list[str]]:
    """Return where to start, and what had to be mended of it."""
    if initial is None:
        return Pose.identity(), []
    if isinstance(initial, Pose):
        return initial, []
    pose = Pose.from_matrix(initial, "initial")
    gap = float(np.abs(pose.matrix[:3, :3] - np.asarray(initial)[:3, :3]).max())
    if gap < _MENDED:
        return pose, []
    return pose, [
        f"initial: its 3x3 part was {gap:.1e} away from a rotation; the nearest was taken"
    ]


def _local_prior(prior: PosePrior | None, frames: LocalOrigins) -> PosePrior | None:
    if prior is None:
        return None
    return PosePrior(frames.local(prior.pose), prior.covariance)
