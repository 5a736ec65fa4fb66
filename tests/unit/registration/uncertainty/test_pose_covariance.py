import json
import math
import pickle

import numpy as np
import pytest

from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation, log_rotation
from scanlock.optimisation.objectives.constraints import PosePrior
from scanlock.registration.uncertainty.pose_covariance import PoseCovariance

_POSE = Pose.from_step(np.array([4.0, -2.0, 0.5, 0.3, -0.2, 1.1]))
_PLACE = np.array([30.0, -10.0, 2.0])


def _covariance(place=None):
    rng = np.random.default_rng(2)
    half = rng.normal(size=(6, 9)) * np.repeat([2e-3, 2e-4], 3)[:, None]
    return PoseCovariance(half @ half.T, _POSE, np.zeros(3) if place is None else place, "sandwich")


def _drawn(covariance, count=6_000):
    """True poses as the convention says: the place shifted, the rotation turned about it."""
    rng = np.random.default_rng(7)
    errors = rng.multivariate_normal(np.zeros(6), covariance.matrix, count)
    pose, place = covariance.pose, covariance.reference_point
    for error in errors:
        rotation = exp_rotation(error[3:]) @ pose.rotation
        yield Pose(rotation, pose.apply(place) + error[:3] - rotation @ place)


def _scatter(samples):
    samples = np.array(list(samples))
    return samples.T @ samples / len(samples)


@pytest.mark.parametrize("place", [np.zeros(3), _PLACE])
def test_it_says_where_any_point_lands(place):
    covariance, point = _covariance(place), np.array([12.0, 5.0, -1.0])
    moved = (true.apply(point) - _POSE.apply(point) for true in _drawn(covariance))
    expected = covariance.at(point)
    np.testing.assert_allclose(_scatter(moved), expected, atol=0.07 * np.abs(expected).max())
    np.testing.assert_array_equal(covariance.at(place), covariance.matrix[:3, :3])


@pytest.mark.parametrize("place", [np.zeros(3), _PLACE])
def test_the_source_frame_is_that_of_motions_before_the_pose(place):
    covariance = _covariance(place)
    back = _POSE.inverse()

    def local(true):
        step = back @ true
        return np.concatenate([log_rotation(step.rotation), step.translation])

    expected = covariance.in_source_frame_rotation_first()
    found = _scatter(local(true) for true in _drawn(covariance))
    scale = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(found / np.outer(scale, scale), _correlation(expected), atol=0.07)
    first = covariance.in_source_frame()
    np.testing.assert_array_equal(expected[:3, :3], first[3:, 3:])
    np.testing.assert_array_equal(expected[:3, 3:], first[3:, :3])


def _correlation(matrix):
    scale = np.sqrt(np.diag(matrix))
    return matrix / np.outer(scale, scale)


def test_it_can_be_the_prior_of_the_next_call():
    covariance = _covariance()
    prior = PosePrior(_POSE, covariance.matrix)
    error = np.array([1e-3, 2e-3, -1e-3, 1e-4, -3e-4, 2e-4])
    true = Pose(exp_rotation(error[3:]) @ _POSE.rotation, _POSE.translation + error[:3])
    expected = 0.5 * error @ np.linalg.solve(covariance.matrix, error)
    assert prior.linearise(true).value == pytest.approx(expected)


def test_deviations_are_roots_of_the_diagonal():
    covariance = _covariance()
    np.testing.assert_allclose(covariance.deviations**2, np.diag(covariance.matrix))
    assert "forward" in repr(covariance)


def test_it_is_plain_in_a_dictionary_and_survives_pickling():
    covariance = _covariance(_PLACE)
    plain = json.loads(json.dumps(covariance.as_dict(), allow_nan=False))
    np.testing.assert_array_equal(plain["matrix"], covariance.matrix)
    assert plain["units"] is None
    again = pickle.loads(pickle.dumps(covariance))
    np.testing.assert_array_equal(again.matrix, covariance.matrix)
    np.testing.assert_array_equal(again.place, _PLACE)
    assert (again.pose, again.way) == (covariance.pose, covariance.method)
    assert math.isnan(again.units)


@pytest.mark.parametrize("matrix", [np.eye(3), np.full((6, 6), np.nan), np.full((6, 6), np.inf)])
def test_what_is_no_covariance_is_refused(matrix):
    with pytest.raises(InvalidInput, match="finite"):
        PoseCovariance(matrix, _POSE, np.zeros(3), "hessian")


@pytest.mark.parametrize("point", [np.zeros(2), np.array([0.0, np.nan, 0.0])])
def test_a_point_that_is_none_is_refused(point):
    with pytest.raises(InvalidInput, match="three finite coordinates"):
        _covariance().at(point)
    with pytest.raises(InvalidInput, match="three finite coordinates"):
        _covariance(point)
