"""Registrations of the ladar experiment and the mean distances of closest points."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Points
from scanlock.evaluation.closest_distances import closest_distances, inlier_mean
from scanlock.experiments.experiment import Outcome, Progress
from scanlock.experiments.ladar.series import DRIVES, LadarDrive, pairs_of
from scanlock.experiments.pairwise import SOLVED
from scanlock.geometry.pose import Pose
from scanlock.pipelines.study import StudyPair, StudyRecord


@dataclass(frozen=True, slots=True, eq=False)
class LadarOutcome:
    """Registrations with the mean distances of closest points.

    Attributes
    ----------
    outcome : Outcome
    after : mapping to float [m]
        Mean distance at the resulting pose by names of pair, start and contender; see
        `inlier_mean`.
    exact : mapping of str to float [m]
        Mean distance at the exact pose by the name of the pair.
    """

    outcome: Outcome
    after: Mapping[tuple[str, str, str], float]
    exact: Mapping[str, float]

    @property
    def places(self) -> int:
        """Number of places of each drive."""
        return len(self.outcome.pairs) // len(DRIVES)

    def pairs(self, drive: LadarDrive) -> list[StudyPair]:
        """Return the pairs of a drive, one per place."""
        return pairs_of(drive, self.outcome.pairs)

    def records(self, drive: LadarDrive, start: str, contender: str) -> list[StudyRecord]:
        """Return the records of a contender for a drive and a start, one per place."""
        wanted = {pair.name for pair in self.pairs(drive)}
        return [
            record
            for record in self.outcome.records[contender]
            if record.task.pair in wanted and record.task.start == start
        ]

    def distances(self, drive: LadarDrive, start: str, contender: str) -> list[float]:
        """Return the mean distance [m] at each place."""
        return [self.after[pair.name, start, contender] for pair in self.pairs(drive)]

    def exact_distances(self, drive: LadarDrive) -> list[float]:
        """Return the mean distance at the exact pose [m] at each place."""
        return [self.exact[pair.name] for pair in self.pairs(drive)]

    def solved(self, drive: LadarDrive, start: str, contender: str) -> int:
        """Return the number of solved places."""
        return sum(SOLVED.accepts(record) for record in self.records(drive, start, contender))


def measure_distances(outcome: Outcome, progress: Progress) -> LadarOutcome:
    """Return the registrations with the mean distances of closest points."""
    after: dict[tuple[str, str, str], float] = {}
    exact: dict[str, float] = {}
    found: dict[str, list[StudyRecord]] = {pair.name: [] for pair in outcome.pairs}
    for records in outcome.records.values():
        for record in records:
            found[record.task.pair].append(record)
    for pair in progress(outcome.pairs, len(outcome.pairs), "measuring distances"):
        model, data = (np.asarray(outcome.series.load(n)) for n in (pair.target, pair.source))
        exact[pair.name] = _mean_distance(model, data, pair.truth)
        for record in found[pair.name]:
            key = (pair.name, record.task.start, record.task.method)
            after[key] = _mean_distance(model, data, record.pose)
    return LadarOutcome(outcome, after, exact)


def _mean_distance(model: Points, data: Points, pose: Pose | None) -> float:
    return math.nan if pose is None else inlier_mean(closest_distances(model, data, pose))
