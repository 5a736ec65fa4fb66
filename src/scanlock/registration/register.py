"""The front door: two scans in, one pose out."""

import math
import time

from numpy.typing import ArrayLike

from scanlock.clouds.point_cloud import PointCloud, caller_pose, local_pose
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.registration.landmarks import Landmarks
from scanlock.registration.methods import DEFAULT_METHOD, METHODS, Method
from scanlock.registration.result import Registration, Status
from scanlock.registration.stages import StageClock
from scanlock.registration.verdict import (
    gaussian_overlap,
    judge,
    score_correlation,
    weakest_direction,
)

_LEAST_PARTS = 4
"""Three Gaussians can be laid over three others by chance; four hardly ever."""


def register(
    source: ArrayLike | PointCloud,
    target: ArrayLike | PointCloud,
    *,
    method: str | Method = DEFAULT_METHOD,
    initial: ArrayLike | Pose | None = None,
) -> Registration:
    """Return the pose that carries the source scan onto the target scan.

    Parameters
    ----------
    source, target : (n, 3+) array or PointCloud [m]
        Two scans, each in its sensor's frame with z roughly upwards, or both in one map frame;
        float32 or float64. Columns past the third are ignored, rows with NaN or Inf left out.
        The target stays, the source moves (the papers' reference and scene).
    method : str or Method
        A key of `METHODS`, or a method with settings of your own such as ``SgcNdt(...)``.
    initial : (4, 4) array or Pose, optional
        Where to start, target from source; the identity by default.

    Returns
    -------
    Registration
        ``target_from_source`` with a status; look at ``result.ok`` before using the pose.

    Raises
    ------
    InvalidInput
        A scan of the wrong shape or type or without a finite point, an unknown method, or an
        initial pose that is no rigid motion.
    """
    name, chosen = _method(method)
    clock = StageClock()
    begin = time.perf_counter()
    with clock.stage("check"):
        target_cloud = PointCloud.from_array(target, "target")
        source_cloud = PointCloud.from_array(source, "source")
        start = _start(initial)
    target_marks, source_marks = chosen.prepare(target_cloud), chosen.prepare(source_cloud)
    for marks in (target_marks, source_marks):
        for stage, seconds in marks.timings.items():
            clock.seconds[stage] = clock.seconds.get(stage, 0.0) + seconds
    notes = _notes(target_marks, source_marks)

    parts = {"target": len(target_marks.gaussians[-1]), "source": len(source_marks.gaussians[-1])}
    if min(parts.values()) < _LEAST_PARTS:
        side = min(parts, key=lambda key: parts[key])
        reason = (
            f"the {side} holds {parts[side]} parts besides the ground, of {_LEAST_PARTS} needed"
        )
        clock.seconds["total"] = time.perf_counter() - begin
        return Registration(
            start, Status.NO_FEATURES, reason, name, math.nan, math.nan, (), clock.seconds, notes
        )

    with clock.stage("align"):
        solution = chosen.align(
            target_marks, source_marks, local_pose(start, target_cloud, source_cloud)
        )
    with clock.stage("verdict"):
        both = target_marks.gaussians[-1], source_marks.gaussians[-1]
        overlap = gaussian_overlap(*both, solution.pose)
        score = score_correlation(*both, solution.pose)
        status, reason = judge(solution, overlap, score, *weakest_direction(both[0]))
    clock.seconds["total"] = time.perf_counter() - begin
    pose = caller_pose(solution.pose, target_cloud, source_cloud)
    return Registration(
        pose, status, reason, name, overlap, score, solution.history, clock.seconds, notes
    )


def _method(method: str | Method) -> tuple[str, Method]:
    if not isinstance(method, str):
        return type(method).__name__, method
    if method not in METHODS:
        raise InvalidInput(f"method must be one of {', '.join(METHODS)}, got {method!r}")
    return method, METHODS[method]


def _start(initial: ArrayLike | Pose | None) -> Pose:
    if initial is None:
        return Pose.identity()
    return initial if isinstance(initial, Pose) else Pose.from_matrix(initial)


def _notes(target: Landmarks, source: Landmarks) -> tuple[str, ...]:
    notes: list[str] = []
    for role, marks in (("target", target), ("source", source)):
        cloud = marks.cloud
        if cloud.dropped_count:
            notes.append(f"{role}: {cloud.dropped_count} rows with NaN or Inf left out")
        if cloud.origin.any():
            notes.append(f"{role}: computed about the origin {cloud.origin.tolist()} m")
        notes.extend(f"{role}: {note}" for note in marks.notes)
    return tuple(notes)
