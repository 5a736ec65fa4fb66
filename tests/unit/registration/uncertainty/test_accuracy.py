"""Accuracy of a pose at a point, along the axes of a map or a sensor."""

import json
import math
import pickle

import numpy as np
import pytest

from scanlock.geometry.pose import Pose
from scanlock.registration.uncertainty.accuracy import PoseAccuracy, length_text
from scanlock.registration.uncertainty.pose_covariance import PoseCovariance

_UTM = np.array([636_000.0, 5_281_000.0, 400.0])


def _covariance(variances, pose=None, reference_point=(0.0, 0.0, 0.0)):
    return PoseCovariance(
        matrix=np.diag(np.array(variances, float) ** 2),
        pose=pose or Pose.identity(),
        reference_point=np.array(reference_point),
        method="sandwich",
    )


def test_deviations_of_a_map_are_along_its_axes_at_the_point():
    # A turn of 1 mrad about up moves a point 10 m east of the reference point by 10 mm north.
    covariance = _covariance([0.003, 0.004, 0.001, 0.0, 0.0, 1e-3], reference_point=_UTM)
    accuracy = PoseAccuracy.of(covariance, np.array([10.0, 0.0, 0.0]) + _UTM, "map")
    np.testing.assert_allclose(accuracy.translation, [0.003, math.hypot(0.004, 0.01), 0.001])
    np.testing.assert_allclose(accuracy.rotation, [0.0, 0.0, 1e-3])
    assert accuracy.axes == ("east", "north", "up")
    assert accuracy.weakest_axis == "north"


def test_deviations_of_a_sensor_are_along_its_own_axes():
    # The source looks along y of the target.
    turn = Pose.from_step(np.array([0.0, 0.0, 0.0, 0.0, 0.0, math.pi / 2]))
    accuracy = PoseAccuracy.of(
        _covariance([1e-3, 9e-3, 2e-3, 1e-4, 2e-4, 3e-4], turn), np.zeros(3), "sensor"
    )
    np.testing.assert_allclose(accuracy.translation, [9e-3, 1e-3, 2e-3], rtol=1e-9)
    np.testing.assert_allclose(accuracy.rotation, [2e-4, 1e-4, 3e-4], rtol=1e-9)
    assert accuracy.weakest_axis == "forward"


def test_the_deviations_at_a_point_do_not_depend_on_the_reference_point():
    near = PoseAccuracy.of(_covariance([1e-3] * 3 + [1e-4] * 3), np.array([5.0, 1.0, 2.0]), "map")
    matrix = np.diag([1e-6] * 3 + [1e-8] * 3)
    other = np.array([40.0, -3.0, 1.0])
    # The same belief, told about another point: the rotation moves it.
    jacobian = Pose(np.eye(3), -other).adjoint()
    moved = PoseCovariance(
        matrix=jacobian @ matrix @ jacobian.T,
        pose=Pose.identity(),
        reference_point=other,
        method="sandwich",
    )
    again = PoseAccuracy.of(moved, np.array([5.0, 1.0, 2.0]), "map")
    np.testing.assert_allclose(again.translation, near.translation, rtol=1e-9)


def test_the_sentence_names_position_rotation_and_the_weakest_axis():
    accuracy = PoseAccuracy.of(
        _covariance([6e-3, 2e-3, 2e-3, 2e-4, 1e-4, 1e-4]), np.zeros(3), "map"
    )
    position = math.sqrt((36 + 4 + 4) / 3)
    degrees = math.degrees(1e-4 * math.sqrt(2.0))
    assert str(accuracy) == (
        f"{position:.1f} mm and {degrees:.4f} deg at one sigma, weakest east, 6.0 mm"
    )
    for expected in ("east 6.0", "north 2.0", "about up 0.0057", "mm", "deg"):
        assert expected in accuracy.details()
    assert "\n" not in repr(accuracy)


@pytest.mark.parametrize(
    ("metres", "text"),
    [
        (0.0, "0 mm"),
        (4e-4, "0.40 mm"),
        (0.0123, "12 mm"),
        (0.9994, "999 mm"),
        (1.26, "1.3 m"),
        (640.0, "640 m"),
    ],
)
def test_lengths_have_two_digits_and_no_exponent(metres, text):
    assert length_text(metres) == text


def test_an_accuracy_is_plain_data():
    accuracy = PoseAccuracy.of(_covariance([1e-3] * 6), np.array([1.0, 2.0, 3.0]), "sensor")
    content = json.loads(json.dumps(accuracy.as_dict()))
    assert content["translation_m"].keys() == {"forward", "left", "up"}
    assert content["rotation_deg"].keys() == {"roll", "pitch", "yaw"}
    again = pickle.loads(pickle.dumps(accuracy))
    assert repr(again) == repr(accuracy)
