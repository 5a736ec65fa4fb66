"""Studies: every pair of scans, registered by every method from every start, one record each."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from scanlock.arrays import Vector
from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import InvalidInput, ScanlockError, require_count
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import rotation_angle
from scanlock.optimisation.solvers.solution import Iteration
from scanlock.pipelines.starts import FromIdentity, StartPlan
from scanlock.pipelines.study_scans import StudyScans
from scanlock.registration.methods.protocol import Method
from scanlock.registration.register import register
from scanlock.registration.result import RegistrationResult
from scanlock.registration.verification.status import Status

FAILED = "failed"
"""Status of a record whose registration raised a `ScanlockError`."""


@dataclass(frozen=True, kw_only=True, slots=True)
class StudyPair:
    """Two scans to register, by name."""

    target: str
    """Name of the target scan."""

    source: str
    """Name of the source scan."""

    truth: Pose | None = None
    """True pose, ``target_from_source``; None where unknown."""

    @property
    def name(self) -> str:
        """Name of the pair, of its two scans."""
        return f"{self.target} {self.source}"


@dataclass(frozen=True, slots=True)
class StudyTask:
    """One registration of a study: names of a pair, a method and a start."""

    pair: str
    """Name of the pair."""

    method: str
    """Name of the method in the study."""

    start: str
    """Name of the start in the plan of the study."""


@dataclass(frozen=True, kw_only=True, slots=True)
class StudyRecord:
    """Result of one registration of a study.

    Attributes
    ----------
    task : StudyTask
    status : str
        Value of a `Status`, or `FAILED` where an error was raised.
    reason : str
        Explanation of the status, or the error message.
    start, pose : Pose or None
        Initial and estimated pose, target from source; None where an error was raised.
    overlap, score : float
        As in `RegistrationResult`; NaN where they are unknown.
    evaluations : int
        Number of evaluations of the objective.
    mean_distance : float [m]
        Mean distance of the last correspondences, for ICP methods; NaN for others.
    translation_error, rotation_error : float [m], [rad]
        Errors of the pose at `centre`; NaN without a pose or a true pose.
    centre : tuple of 3 floats [m]
        Centre of the source: zero in the frame of a sensor, near the points in map coordinates.
    notes : tuple of str
        Notes of the result.
    seconds : float [s]
        Wall time of preparing and registering both scans, without compiling; NaN where it is
        unknown. It is ignored when records are compared.
    """

    task: StudyTask
    status: str
    reason: str
    start: Pose | None
    pose: Pose | None
    overlap: float = math.nan
    score: float = math.nan
    evaluations: int = 0
    mean_distance: float = math.nan
    translation_error: float = math.nan
    rotation_error: float = math.nan
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    notes: tuple[str, ...] = ()
    seconds: float = field(default=math.nan, compare=False)

    @property
    def ok(self) -> bool:
        """Whether the status is ``"ok"``."""
        return self.status == Status.OK.value

    def is_solved(self, translation: float, rotation: float) -> bool:
        """Return whether both errors are at most `translation` [m] and `rotation` [rad].

        False where the true pose is unknown.
        """
        return self.translation_error <= translation and self.rotation_error <= rotation

    def with_truth(self, truth: Pose | None) -> "StudyRecord":
        """Return a copy with the errors against this true pose; NaN for None."""
        metres, radians = math.nan, math.nan
        if self.pose is not None and truth is not None:
            metres, radians = pose_errors(self.pose, truth, np.array(self.centre))
        return replace(self, translation_error=metres, rotation_error=radians)


@dataclass(frozen=True, kw_only=True, slots=True)
class Study:
    """All combinations of pairs, methods and starts, in this order of nesting."""

    methods: Mapping[str, Method[Any]]
    """Methods, by the names that appear in records."""

    pairs: Sequence[StudyPair]
    """Pairs to register; a scan shared by consecutive pairs is loaded and prepared once."""

    load: Callable[[str], ArrayLike | PointCloud]
    """Function that returns the (n, 3+) points [m] of a scan, given its name."""

    starts: StartPlan = field(default_factory=FromIdentity)
    """Initial poses of every pair."""

    threads: int = 1
    """Maximum number of threads of a registration; records do not depend on it, but their times
    do."""

    def __post_init__(self) -> None:
        require_count("threads", self.threads)
        for argument, names in (
            ("methods", [*self.methods]),
            ("pairs", [pair.name for pair in self.pairs]),
            ("names of starts", [*self.starts.names]),
        ):
            if not names or len(set(names)) < len(names):
                raise InvalidInput(f"{argument} must be unique and at least one, got {names}")

    def tasks(self) -> Iterator[StudyTask]:
        """Yield all registrations, in the order in which they run."""
        for pair in self.pairs:
            yield from self._tasks_of(pair)

    def __len__(self) -> int:
        return len(self.pairs) * len(self.methods) * len(self.starts.names)

    def records(
        self, known: Mapping[StudyTask, StudyRecord] | None = None
    ) -> Iterator[StudyRecord]:
        """Register every task and yield its record, in the order of `tasks`.

        Errors of a scan or a registration become records with the status `FAILED`. Each method
        registers its first pair once more before, so that no time includes compiling.

        Parameters
        ----------
        known : mapping of StudyTask to StudyRecord, optional
            Records to yield instead of registering their tasks again.
        """
        known = known or {}
        registrations = _Registrations(self)
        for pair in self.pairs:
            for task in self._tasks_of(pair):
                yield known[task] if task in known else registrations.record(pair, task)
            registrations.scans.keep_only(pair.source)

    def _tasks_of(self, pair: StudyPair) -> Iterator[StudyTask]:
        for method in self.methods:
            for start in self.starts.names:
                yield StudyTask(pair.name, method, start)


class _Registrations:
    """Registrations of a study, with the scans that they share."""

    def __init__(self, study: Study) -> None:
        self.scans = StudyScans(study.methods, study.load, study.threads)
        self._study = study
        self._warm: set[str] = set()

    def record(self, pair: StudyPair, task: StudyTask) -> StudyRecord:
        self._warm_up(pair, task)
        try:
            target, source = (
                self.scans.prepared(name, task.method) for name in (pair.target, pair.source)
            )
            centre = source.cloud.origin
            start = self._study.starts.pose(task.start, pair.name, pair.truth, centre)
            result = register(
                source=source,
                target=target,
                method=target.method,
                initial=start,
                covariance=False,
                threads=self._study.threads,
            )
        except ScanlockError as error:
            return StudyRecord(task=task, status=FAILED, reason=str(error), start=None, pose=None)
        preparing = sum(sum(scan.timings.values()) for scan in (target, source))
        seconds = preparing + result.timings["total"]
        return _record_of(task, pair, start, result, centre, seconds)

    def _warm_up(self, pair: StudyPair, task: StudyTask) -> None:
        """Register the first pair of a method once more, so that its kernels are loaded."""
        if task.method in self._warm:
            return
        self._warm.add(task.method)
        # An error is raised again by the registration that counts.
        with suppress(ScanlockError):
            target, source = (self.scans.cloud(name) for name in (pair.target, pair.source))
            method = self._study.methods[task.method]
            start = self._study.starts.pose(task.start, pair.name, pair.truth, source.origin)
            register(source=source, target=target, method=method, initial=start, covariance=False)


def pose_errors(pose: Pose, truth: Pose, centre: Vector) -> tuple[float, float]:
    """Compute the errors of a pose: translation [m] at a point of the source, rotation [rad].

    Parameters
    ----------
    pose, truth : Pose
        Target from source.
    centre : (3,) [m]
        Point of the source at which the translation error is taken. In map coordinates, a small
        rotation error about the far origin would else dominate it.
    """
    metres = float(np.linalg.norm(pose.apply(centre) - truth.apply(centre)))
    return metres, rotation_angle(truth.rotation.T @ pose.rotation)


def _record_of(
    task: StudyTask,
    pair: StudyPair,
    start: Pose,
    result: RegistrationResult,
    centre: Vector,
    seconds: float,
) -> StudyRecord:
    x, y, z = centre.tolist()
    record = StudyRecord(
        task=task,
        status=result.status.value,
        reason=result.reason,
        start=start,
        pose=result.target_from_source,
        overlap=result.overlap,
        score=result.score,
        evaluations=result.evaluations,
        mean_distance=_last_distance(result.history),
        centre=(x, y, z),
        notes=result.notes,
        seconds=seconds,
    )
    return record.with_truth(pair.truth)


def _last_distance(history: Sequence[Iteration]) -> float:
    accepted = [step.mean_distance for step in history if step.accepted]
    return accepted[-1] if accepted else math.nan
