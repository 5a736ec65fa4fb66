import json
import math
import pickle
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest

from reference.samples import yaw_pose
from scanlock.geometry.pose import Pose
from scanlock.optimisation.solvers.solution import Iteration
from scanlock.registration.result import RegistrationResult
from scanlock.registration.verification.metrics import Metrics
from scanlock.registration.verification.observability import DirectionObservability
from scanlock.registration.verification.status import Status

_POSE = yaw_pose(math.pi / 6.0, (3.0, 4.0, 0.0))


def _result(status=Status.OK, **metrics):
    history = (Iteration(-0.5, 0.1, 0.0, True, Pose.identity()),)
    timings = {"align": 0.25, "total": 0.5}
    weak = DirectionObservability(
        kind="translation", axis=np.array([1.0, 0.0, 0.0]), ratio=0.001, deviation=0.5
    )
    firm = DirectionObservability(
        kind="rotation", axis=np.array([0.0, 0.0, 1.0]), ratio=1.0, deviation=0.001
    )
    seen = {"overlap": 0.9, "target_overlap": 0.7, "inlier_rmse": 0.05, "fitness": 0.6}
    known = Metrics(**{**seen, "score": 0.8, **metrics})
    return RegistrationResult(
        _POSE, status, "because", "a-method", known, 0.75, (weak, firm), history, timings,
        ("a note",),
    )  # fmt: skip


@pytest.mark.parametrize("status", Status)
def test_only_ok_is_ok(status):
    assert _result(status).ok == (status is Status.OK)


def test_json_keeps_every_digit():
    plain = json.loads(_result().to_json())
    assert plain == _result().as_dict()
    assert plain["status"] == "ok"
    assert plain["iterations"] == 1
    assert plain["timings_s"] == {"align": 0.25, "total": 0.5}
    np.testing.assert_array_equal(plain["target_from_source"], _POSE.matrix)


def test_what_is_unknown_is_null_in_json():
    result = _result(Status.NO_CORRESPONDENCES, overlap=math.nan)
    metrics = json.loads(result.to_json())["metrics"]
    assert metrics["overlap"] is None
    assert metrics["free_space_violation"] is None
    assert metrics["score"] == 0.8


def test_a_result_cannot_be_changed():
    result = _result()
    with pytest.raises(FrozenInstanceError):
        result.status = Status.OK  # type: ignore[misc]
    with pytest.raises(TypeError):
        result.timings["total"] = 0.0  # type: ignore[index]


def test_a_pickle_holds_the_same_result():
    again = pickle.loads(pickle.dumps(_result()))
    assert again.as_dict() == _result().as_dict()
    assert again.history[0].pose == Pose.identity()


def test_the_repr_is_one_line_with_the_motion_and_the_verdict():
    text = repr(_result())
    assert "\n" not in text
    for part in ("status=ok", "a-method", "5.000 m 30.00 deg", "overlap=0.90", "500.0 ms"):
        assert part in text
    assert "nan" in repr(_result(Status.NO_CORRESPONDENCES, overlap=math.nan))


def test_the_shortcuts_are_the_metrics():
    result = _result(runner_up_ratio=0.4)
    assert (result.overlap, result.score, result.runner_up_ratio) == (0.9, 0.8, 0.4)


def test_only_directions_that_nothing_holds_are_weak():
    (weak,) = _result().degenerate_directions
    assert weak.name == "forward"
    assert [one["is_weak"] for one in _result().as_dict()["directions"]] == [True, False]


@pytest.mark.parametrize("shown", [str, lambda result: result._repr_html_()])
def test_people_read_a_small_table(shown):
    text = shown(_result(Status.DEGENERATE, free_space_violation=math.nan))
    for part in ("degenerate: because", "0.750", "0.050 m", "forward", "a note", "90%"):
        assert part in text
    assert "violation" not in text
    assert "nan" not in text


def test_a_table_for_notebooks_escapes_what_is_not_its_own():
    result = replace(_result(), reason="a < b & c")
    assert "a &lt; b &amp; c" in result._repr_html_()
    assert "a < b & c" in str(result)
