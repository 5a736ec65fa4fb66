import json
import math
import pickle
from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from reference.samples import yaw_pose
from scanlock.geometry.pose import Pose
from scanlock.registration.result import Registration, Status
from scanlock.solvers.solution import Iteration

_POSE = yaw_pose(math.pi / 6.0, (3.0, 4.0, 0.0))


def _result(status=Status.OK, overlap=0.9, score=0.8):
    history = (Iteration(-0.5, 0.1, 0.0, True, Pose.identity()),)
    timings = {"align": 0.25, "total": 0.5}
    return Registration(
        _POSE, status, "because", "a-method", overlap, score, history, timings, ("a note",)
    )


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
    result = _result(Status.NO_FEATURES, math.nan, math.nan)
    plain = json.loads(result.to_json())
    assert plain["overlap"] is None
    assert plain["score"] is None


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
    assert "nan" in repr(_result(Status.NO_FEATURES, math.nan, math.nan))
