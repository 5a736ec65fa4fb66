import math
import time
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from reference.samples import street, yaw_pose
from scanlock import METHODS, InvalidInput, Pose, SgcNdt, Status
from scanlock.pipelines import study as module
from scanlock.pipelines.starts import AroundTruth
from scanlock.pipelines.study import FAILED, Study, StudyPair, StudyTask

STEP = yaw_pose(0.1, (1.0, 0.4, 0.0))
NAMES = ("a", "b", "c")
METHOD = METHODS["sgc-ndt-d2d"]


@pytest.fixture(scope="module")
def scans():
    """Three scans of one street, each a step further."""
    pose = Pose.identity()
    found = {}
    for seed, name in enumerate(NAMES, start=1):
        found[name] = pose.inverse().apply(street(seed))
        pose = pose @ STEP
    return found


def _pairs(truth=STEP):
    return [StudyPair(target=a, source=b, truth=truth) for a, b in pairwise(NAMES)]


def _study(scans, **changes):
    defaults = {"methods": {"d2d": METHOD}, "pairs": _pairs(), "load": scans.__getitem__}
    return Study(**(defaults | changes))


def test_records_have_the_order_of_the_tasks_and_errors_to_the_truth(scans):
    study = _study(scans, methods={"d2d": METHOD, "p2d": METHODS["sgc-ndt-p2d"]})
    tasks = list(study.tasks())
    assert tasks[1] == StudyTask("a b", "p2d", "identity")
    records = list(study.records())
    assert len(study) == len(records) == 4
    assert [record.task for record in records] == tasks
    for record in records:
        assert record.ok
        assert record.is_solved(0.1, 0.01)
        metres, radians = record.pose.distance(STEP)
        assert record.translation_error == pytest.approx(metres, abs=1e-9)
        assert record.rotation_error == pytest.approx(radians, abs=1e-9)
        assert record.evaluations > 1
        assert record.seconds > 0.0
        assert math.isnan(record.mean_distance)


def test_a_record_is_yielded_before_the_next_pair_is_loaded(scans):
    loaded = []

    def load(name):
        loaded.append(name)
        return scans[name]

    records = _study(scans, load=load).records()
    assert loaded == []
    next(records)
    assert loaded == ["a", "b"]
    assert len(list(records)) == 1
    # The scan that both pairs share is loaded once.
    assert loaded == ["a", "b", "c"]


def test_the_time_of_a_record_does_not_include_compiling(scans, monkeypatch):
    real, calls = module.register, []

    def register(**keywords):
        calls.append(keywords["method"])
        if calls.count(calls[-1]) == 1:
            time.sleep(2.0)
        return real(**keywords)

    monkeypatch.setattr(module, "register", register)
    study = _study(scans, methods={"d2d": METHOD, "p2d": METHODS["sgc-ndt-p2d"]})
    records = list(study.records())
    # The first registration of a method, here a slow one, is repeated.
    assert len(calls) == len(records) + 2
    assert all(0.0 < record.seconds < 1.0 for record in records)


def test_threads_do_not_change_the_records(scans):
    assert list(_study(scans, threads=2).records()) == list(_study(scans).records())
    with pytest.raises(InvalidInput, match="threads must be a whole number"):
        _study(scans, threads=0)


def test_known_records_are_yielded_without_loading_a_scan(scans):
    study = _study(scans)
    first, second = study.records()

    def refuse(name):
        raise AssertionError(name)

    known = {first.task: first, second.task: second}
    assert list(replace(study, load=refuse).records(known)) == [first, second]
    again = list(study.records({first.task: replace(first, reason="known")}))
    assert again == [replace(first, reason="known"), second]


def test_records_have_their_initial_poses(scans):
    plan = AroundTruth(distances=(1.0,), angles=(0.0, 0.2))
    study = _study(scans, pairs=_pairs()[:1], starts=plan)
    records = list(study.records())
    assert [record.task.start for record in records] == list(plan.names)
    for record in records:
        level = plan.levels[record.task.start]
        assert record.start.distance(STEP) == pytest.approx(level, abs=1e-7)
        assert record.is_solved(0.1, 0.01)


def test_without_a_truth_errors_are_nan_and_no_record_is_solved(scans):
    record = next(_study(scans, pairs=_pairs(truth=None)).records())
    assert record.ok
    assert math.isnan(record.translation_error)
    assert not record.is_solved(10.0, 3.0)


def test_an_invalid_scan_fails_only_its_own_pairs(scans):
    def load(name):
        return np.full((10, 3), np.nan) if name == "c" else scans[name]

    good, bad = _study(scans, load=load).records()
    assert good.ok
    assert (bad.status, bad.pose, bad.start) == (FAILED, None, None)
    assert "scan c has no finite point" in bad.reason


def test_scans_without_correspondences_are_a_status_not_a_failure(scans):
    flat = np.random.default_rng(0).uniform(-20.0, 20.0, (2000, 3)) * [1.0, 1.0, 0.0]
    record = next(_study(scans, load=lambda _: flat).records())
    assert record.status == Status.NO_CORRESPONDENCES.value
    assert record.pose == Pose.identity()
    assert math.isnan(record.overlap)


def test_errors_other_than_scanlock_errors_are_raised(scans, monkeypatch):
    def broken(*_, **__):
        raise ZeroDivisionError

    monkeypatch.setattr(module, "register", broken)
    with pytest.raises(ZeroDivisionError):
        next(_study(scans).records())


def test_errors_in_map_coordinates_are_evaluated_at_the_centre_of_the_source(scans):
    far = np.array([4e5, 5e6, 100.0])
    shift = Pose(np.eye(3), far)
    pair = StudyPair(target="a", source="b", truth=shift @ STEP @ shift.inverse())
    plan = AroundTruth(distances=(1.0,), angles=(0.1,))
    study = _study({name: scan + far for name, scan in scans.items()}, pairs=[pair], starts=plan)
    [record] = study.records()
    assert record.is_solved(0.1, 0.01)
    assert np.abs(record.centre - far).max() < 30.0
    metres, radians = record.translation_error, record.rotation_error
    assert record.with_truth(None).with_truth(pair.truth) == record
    lifted = Pose(np.eye(3), np.array([0.0, 0.0, 2.0])) @ pair.truth
    other = record.with_truth(lifted)
    assert other.translation_error == pytest.approx(2.0, abs=metres)
    assert other.rotation_error == pytest.approx(radians, abs=1e-7)


@pytest.mark.parametrize("changes", [{"methods": {}}, {"pairs": []}, {"pairs": _pairs()[:1] * 2}])
def test_empty_or_duplicate_names_are_refused(scans, changes):
    with pytest.raises(InvalidInput, match="must be unique and at least one"):
        _study(scans, **changes)


def test_methods_with_custom_settings_are_accepted(scans):
    study = _study(scans, methods={"mine": SgcNdt(voxel_size=1.0)}, pairs=_pairs()[:1])
    [record] = study.records()
    assert record.task.method == "mine"
