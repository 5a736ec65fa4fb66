"""Many pairs by many methods from many starts, one record each, as soon as it is there."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from scanlock.arrays import Vector
from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import InvalidInput, ScanlockError
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import rotation_angle
from scanlock.optimisation.solvers.solution import Iteration
from scanlock.pipelines.starts import FromIdentity, StartPlan
from scanlock.registration.methods.protocol import Method
from scanlock.registration.prepare import PreparedScan, prepare
from scanlock.registration.register import register
from scanlock.registration.result import RegistrationResult
from scanlock.registration.verification.status import Status

_Made = TypeVar("_Made", PointCloud, PreparedScan)

FAILED = "failed"
"""Status of a record whose registration raised an error."""


@dataclass(frozen=True, kw_only=True, slots=True)
class StudyPair:
    """Two scans to be registered."""

    target: str
    """Name of the scan that stays."""

    source: str
    """Name of the scan that moves."""

    truth: Pose | None = None
    """The true target_from_source, where it is known."""

    @property
    def name(self) -> str:
        """What the pair is called."""
        return f"{self.target} {self.source}"


@dataclass(frozen=True, slots=True)
class StudyTask:
    """One registration of a study, by its names."""

    pair: str
    method: str
    start: str


@dataclass(frozen=True, kw_only=True, slots=True)
class StudyRecord:
    """What came of one registration.

    Attributes
    ----------
    task : StudyTask
    status : str
        Value of a `Status`, or `FAILED` where an error was raised.
    reason : str
        One sentence that explains the status.
    start, pose : Pose or None
        Where the registration began and ended, target from source; None where it failed.
    overlap, score : float
        As in `RegistrationResult`; NaN where nothing was registered.
    evaluations : int
        How often the objective was evaluated.
    mean_distance : float [m]
        Mean distance of the last closest points, for methods that pair points; else NaN.
    translation_error, rotation_error : float [m], [rad]
        How far the pose is from the true one, in the middle of the source; NaN where either is
        missing.
    centre : tuple of 3 floats [m]
        The middle of the source: zero in a sensor's frame, the origin taken off map coordinates.
    notes : tuple of str
    seconds : float [s]
        Wall time of preparing and registering the two scans; NaN for a record that was read from
        a file. Records that differ in nothing else are equal.
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
        """Whether the method calls its pose right."""
        return self.status == Status.OK.value

    def is_solved(self, translation: float, rotation: float) -> bool:
        """Tell whether the pose is within ``translation`` [m] and ``rotation`` [rad] of the truth.

        False where the truth is not known.
        """
        return self.translation_error <= translation and self.rotation_error <= rotation

    def judged_by(self, truth: Pose | None) -> "StudyRecord":
        """Return the record with its errors against another true pose, or against none."""
        metres, radians = math.nan, math.nan
        if self.pose is not None and truth is not None:
            metres, radians = pose_errors(self.pose, truth, np.array(self.centre))
        return replace(self, translation_error=metres, rotation_error=radians)


@dataclass(frozen=True, kw_only=True, slots=True)
class Study:
    """Every pair by every method from every start."""

    methods: Mapping[str, Method[Any]]
    """What to register with, by the name that records carry."""

    pairs: Sequence[StudyPair]
    """What to register; a scan that is in two neighbouring pairs is loaded and prepared once."""

    load: Callable[[str], ArrayLike | PointCloud]
    """Returns the (n, 3+) points [m] of a scan by its name."""

    starts: StartPlan = field(default_factory=FromIdentity)
    """Where to begin."""

    def __post_init__(self) -> None:
        for what, names in (
            ("methods", [*self.methods]),
            ("pairs", [pair.name for pair in self.pairs]),
            ("starts", [*self.starts.names]),
        ):
            if not names or len(set(names)) < len(names):
                raise InvalidInput(f"{what} must have a name each and not be empty, got {names}")

    def tasks(self) -> Iterator[StudyTask]:
        """Yield all registrations in the order in which they are done."""
        for pair in self.pairs:
            yield from self._tasks_of(pair)

    def __len__(self) -> int:
        return len(self.pairs) * len(self.methods) * len(self.starts.names)

    def records(
        self, known: Mapping[StudyTask, StudyRecord] | None = None
    ) -> Iterator[StudyRecord]:
        """Yield a record for every task, in the order of `tasks`.

        Parameters
        ----------
        known : mapping of StudyTask to StudyRecord, optional
            Records to hand out again rather than make anew.
        """
        known = known or {}
        bench = _Bench(self)
        for pair in self.pairs:
            for task in self._tasks_of(pair):
                yield known[task] if task in known else bench.record(pair, task)
            bench.keep_only(pair.source)

    def _tasks_of(self, pair: StudyPair) -> Iterator[StudyTask]:
        for method in self.methods:
            for start in self.starts.names:
                yield StudyTask(pair.name, method, start)


class _Bench:
    """Scans loaded and prepared, as long as they may be wanted again."""

    def __init__(self, study: Study) -> None:
        self._study = study
        self._clouds: dict[str, PointCloud | ScanlockError] = {}
        self._prepared: dict[tuple[str, str], PreparedScan | ScanlockError] = {}

    def keep_only(self, scan: str) -> None:
        self._clouds = {name: cloud for name, cloud in self._clouds.items() if name == scan}
        self._prepared = {key: kept for key, kept in self._prepared.items() if key[0] == scan}

    def record(self, pair: StudyPair, task: StudyTask) -> StudyRecord:
        try:
            target, source = (self._ready(name, task) for name in (pair.target, pair.source))
            centre = source.cloud.origin
            start = self._study.starts.pose(task.start, pair.name, pair.truth, centre)
            result = register(source=source, target=target, method=target.method, initial=start)
        except ScanlockError as error:
            return StudyRecord(task=task, status=FAILED, reason=str(error), start=None, pose=None)
        preparing = sum(sum(scan.timings.values()) for scan in (target, source))
        seconds = preparing + result.timings["total"]
        return _recorded(task, pair, start, result, centre, seconds)

    def _ready(self, scan: str, task: StudyTask) -> PreparedScan:
        key = (scan, task.method)
        if key not in self._prepared:
            try:
                method = self._study.methods[task.method]
                self._prepared[key] = prepare(self._cloud(scan), method=method)
            except ScanlockError as error:
                self._prepared[key] = error
        return _value(self._prepared[key])

    def _cloud(self, scan: str) -> PointCloud:
        if scan not in self._clouds:
            try:
                self._clouds[scan] = PointCloud.from_array(self._study.load(scan), f"scan {scan}")
            except ScanlockError as error:
                self._clouds[scan] = error
        return _value(self._clouds[scan])


def pose_errors(pose: Pose, truth: Pose, centre: Vector) -> tuple[float, float]:
    """Return how far a pose is from the true one: translation [m] and rotation angle [rad].

    The translation is that of a (3,) place in the source: of its middle in map coordinates,
    where a turn about their far origin would look like a long way.
    """
    metres = float(np.linalg.norm(pose.apply(centre) - truth.apply(centre)))
    return metres, rotation_angle(truth.rotation.T @ pose.rotation)


def _value(kept: _Made | ScanlockError) -> _Made:
    if isinstance(kept, ScanlockError):
        raise kept
    return kept


def _recorded(
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
    return record.judged_by(pair.truth)


def _last_distance(history: Sequence[Iteration]) -> float:
    accepted = [step.mean_distance for step in history if step.accepted]
    return accepted[-1] if accepted else math.nan
