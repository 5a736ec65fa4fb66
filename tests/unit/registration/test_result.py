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
    degenerate = DirectionObservability(
        kind="translation", axis=np.array([1.0, 0.0, 0.0]), ratio=0.001, deviation=0.5
    )
    constrained = DirectionObservability(
        kind="rotation", axis=np.array([0.0, 0.0, 1.0]), ratio=1.0, deviation=0.001
    )
    values = {"overlap": 0.9, "target_overlap": 0.7, "inlier_rmse": 0.05, "fitness": 0.6}
    all_metrics = Metrics(**{**values, "score": 0.8, **metrics})
    return RegistrationResult(
        target_from_source=_POSE,
        status=status,
        reason="because",
        method="a-method",
        metrics=all_metrics,
        probability=0.75,
        directions=(degenerate, constrained),
        converged=True,
        hessian=np.eye(6),
        history=history,
        timings=timings,
        notes=("a note",),
    )


@pytest.mark.parametrize("status", Status)
def test_only_ok_is_ok(status):
    assert _result(status).ok == (status is Status.OK)
    assert bool(_result(status)) == _result(status).ok


def test_json_keeps_every_digit():
    plain = json.loads(_result().to_json())
    assert plain == _result().as_dict()
    assert plain["status"] == "ok"
    assert plain["evaluations"] == 1
    assert plain["timings_s"] == {"align": 0.25, "total": 0.5}
    np.testing.assert_array_equal(plain["target_from_source"], _POSE.matrix)


def test_nan_is_null_in_json():
    result = _result(Status.NO_CORRESPONDENCES, overlap=math.nan)
    metrics = json.loads(result.to_json())["metrics"]
    assert metrics["overlap"] is None
    assert metrics["free_space_violation"] is None
    assert metrics["score"] == 0.8


def test_a_result_is_immutable():
    result = _result()
    with pytest.raises(FrozenInstanceError):
        result.status = Status.OK  # type: ignore[misc]
    with pytest.raises(TypeError):
        result.timings["total"] = 0.0  # type: ignore[index]


def test_a_result_can_be_pickled():
    again = pickle.loads(pickle.dumps(_result()))
    assert again.as_dict() == _result().as_dict()
    assert again.history[0].pose == Pose.identity()
    np.testing.assert_array_equal(again.hessian, np.eye(6))


def test_the_repr_is_one_line_with_motion_and_status():
    text = repr(_result())
    assert "\n" not in text
    for expected in ("ok", "a-method", "0.750", "Pose([3, 4, 0] m, [0, 0, 30] deg)"):
        assert expected in text


def test_properties_repeat_the_metrics():
    result = _result(runner_up_ratio=0.4)
    assert (result.overlap, result.score, result.runner_up_ratio) == (0.9, 0.8, 0.4)
    assert (result.fitness, result.inlier_rmse) == (0.6, 0.05)
    np.testing.assert_array_equal(result.transformation, _POSE.matrix)


def test_only_unconstrained_directions_are_degenerate():
    (degenerate,) = _result().degenerate_directions
    assert degenerate.name == "forward"
    assert [one["is_degenerate"] for one in _result().as_dict()["directions"]] == [True, False]


@pytest.mark.parametrize("shown", [str, lambda result: result._repr_html_()])
def test_str_and_html_show_a_small_table(shown):
    text = shown(_result(Status.DEGENERATE, free_space_violation=math.nan))
    for expected in ("degenerate: because", "75.0%", "5.000 m", "30.000 deg", "a note", "90%"):
        assert expected in text
    assert "nan" not in text


def test_details_add_every_known_metric():
    text = _result(free_space_violation=math.nan).details()
    for expected in ("because", "a-method", "0.050 m", "90%"):
        assert expected in text
    assert "free space" not in text
    assert "nan" not in text


def test_a_result_without_correspondences_shows_no_pose():
    text = str(_result(Status.NO_CORRESPONDENCES))
    assert "no_correspondences: because" in text
    assert "pose" not in text
    assert "right with" not in text


def test_the_notebook_table_escapes_html():
    result = replace(_result(Status.UNVERIFIED), reason="a < b & c")
    assert "a &lt; b &amp; c" in result._repr_html_()
    assert "a < b & c" in str(result)
