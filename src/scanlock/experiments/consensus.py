"""Consensus of methods on the pose of a pair, in place of an unknown true pose."""

from collections.abc import Sequence

from scanlock.experiments.pairwise import SOLVED, Tolerance
from scanlock.geometry.pose import Pose
from scanlock.pipelines.study import StudyRecord


def consensus(
    records: Sequence[StudyRecord], tolerance: Tolerance = SOLVED
) -> tuple[StudyRecord, ...]:
    """Return the registrations of one pair that agree with the one that most others agree with.

    Only registrations with status ok count.

    Parameters
    ----------
    records : sequence of StudyRecord
        One per method.
    tolerance : Tolerance
        Maximum difference of two poses that agree.

    Returns
    -------
    tuple of StudyRecord
        The one with most support first, the others by overlap times score; empty where no two
        agree.
    """
    accepted = [record for record in records if record.ok]
    agreeing = [
        [other for other in accepted if other is not record and _agree(record, other, tolerance)]
        for record in accepted
    ]
    ranks = [
        (len(others), _quality(record)) for record, others in zip(accepted, agreeing, strict=True)
    ]
    if not ranks or max(ranks)[0] == 0:
        return ()
    best = ranks.index(max(ranks))
    return accepted[best], *sorted(agreeing[best], key=_quality, reverse=True)


def reference_pose(agreeing: Sequence[StudyRecord], method: str) -> Pose | None:
    """Return the pose of a consensus with which a method is compared: the best of another method.

    Its own pose would have no error. None without a consensus.
    """
    return next((record.pose for record in agreeing if record.task.method != method), None)


def _quality(record: StudyRecord) -> float:
    return record.overlap * record.score


def _agree(one: StudyRecord, other: StudyRecord, tolerance: Tolerance) -> bool:
    return tolerance.accepts(one.with_truth(other.pose))
