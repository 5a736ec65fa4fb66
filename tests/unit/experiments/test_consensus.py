import math
from dataclasses import replace

import pytest

from reference.samples import yaw_pose
from reference.studies import STEP, record_of
from scanlock.experiments.consensus import consensus, reference_pose
from scanlock.pipelines.study import StudyPair

PAIR = StudyPair(target="a", source="b")
FAR = yaw_pose(1.0, (9.0, 0.0, 0.0))
NEAR, OTHER = (yaw_pose(0.051, (0.81, 0.1, 0.0)), yaw_pose(0.052, (0.80, 0.1, 0.0)))


def _record(method, pose, *, status="ok", overlap=0.5, score=0.5):
    record = record_of(PAIR, method, (math.nan, math.nan), pose, status)
    return replace(record, overlap=overlap, score=score)


RECORDS = [
    _record("a", FAR, score=1.0),
    _record("b", NEAR),
    _record("c", STEP, score=0.6),
    _record("d", OTHER, score=0.55),
]


def test_the_consensus_is_the_pose_with_most_support():
    found = consensus(RECORDS)
    assert [record.task.method for record in found] == ["c", "d", "b"]
    assert consensus(RECORDS[:2]) == ()
    assert consensus([]) == ()


@pytest.mark.parametrize(("method", "pose"), [("a", STEP), ("b", STEP), ("c", OTHER), ("d", STEP)])
def test_a_method_is_not_compared_with_its_own_pose(method, pose):
    assert reference_pose(consensus(RECORDS), method) == pose


def test_there_is_no_reference_without_a_consensus():
    assert reference_pose(consensus(RECORDS[:2]), "a") is None


def test_another_group_of_equal_size_is_no_reference():
    other = [_record("e", FAR, score=0.9), RECORDS[0]]
    found = consensus([*other, *RECORDS[1:3]])
    assert [record.task.method for record in found] == ["a", "e"]
    assert reference_pose(found, "a") == FAR


def test_poses_without_status_ok_do_not_count_for_the_consensus():
    records = [
        _record("a", STEP),
        _record("b", STEP, status="low_overlap"),
        _record("c", None, status="failed"),
    ]
    assert consensus(records) == ()
