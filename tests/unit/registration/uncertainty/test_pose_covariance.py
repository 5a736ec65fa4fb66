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
_ORIGIN, _POINT = np.zeros(3), np.array([30.0, -10.0, 2.0])


def _covariance(reference_point=_ORIGIN, matrix=None):
    rng = np.random.default_rng(2)
    half = rng.normal(size=(6, 9)) * np.repeat([2e-3, 2e-4], 3)[:, None]
    return PoseCovariance(
        matrix=half @ half.T if matrix is None else matrix,
        pose=_POSE,
        reference_point=reference_point,
        method="sandwich",
    )


def _true_poses(covariance, count=6_000):
    """True poses by the convention: the reference point shifted, the rotation about it."""
    rng = np.random.default_rng(7)
    errors = rng.multivariate_normal(np.zeros(6), covariance.matrix, count)
    pose, point = covariance.pose, covariance.reference_point
    for error in errors:
        rotation = exp_rotation(error[3:]) @ pose.rotation
        yield Pose(rotation, pose.apply(point) + error[:3] - rotation @ point)


def _scatter(samples):
    samples = np.array(list(samples))
    return samples.T @ samples / len(samples)


@pytest.mark.slow
@pytest.mark.parametrize("reference_point", [_ORIGIN, _POINT])
def test_the_covariance_of_any_point_follows_from_that_of_the_reference_point(reference_point):
    covariance, point = _covariance(reference_point), np.array([12.0, 5.0, -1.0])
    errors = (true.apply(point) - _POSE.apply(point) for true in _true_poses(covariance))
    expected = covariance.point_covariance(point)
    np.testing.assert_allclose(_scatter(errors), expected, atol=0.07 * np.abs(expected).max())
    np.testing.assert_array_equal(
        covariance.point_covariance(reference_point), covariance.matrix[:3, :3]
    )


@pytest.mark.slow
@pytest.mark.parametrize("reference_point", [_ORIGIN, _POINT])
def test_the_covariance_in_the_source_frame_is_that_of_motions_before_the_pose(reference_point):
    covariance = _covariance(reference_point)
    inverse = _POSE.inverse()

    def motion(true):
        step = inverse @ true
        return np.concatenate([log_rotation(step.rotation), step.translation])

    expected = covariance.in_source_frame_rotation_first()
    found = _scatter(motion(true) for true in _true_poses(covariance))
    scale = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(found / np.outer(scale, scale), _correlation(expected), atol=0.07)
    translation_first = covariance.in_source_frame()
    np.testing.assert_array_equal(expected[:3, :3], translation_first[3:, 3:])
    np.testing.assert_array_equal(expected[:3, 3:], translation_first[3:, :3])


def _correlation(matrix):
    scale = np.sqrt(np.diag(matrix))
    return matrix / np.outer(scale, scale)


def test_a_covariance_has_the_conventions_of_a_prior():
    covariance = _covariance()
    prior = PosePrior(_POSE, covariance.matrix)
    error = np.array([1e-3, 2e-3, -1e-3, 1e-4, -3e-4, 2e-4])
    expected = 0.5 * error @ np.linalg.solve(covariance.matrix, error)
    assert prior.linearise(_POSE.perturbed(error)).value == pytest.approx(expected)


def test_deviations_are_square_roots_of_the_diagonal():
    covariance = _covariance()
    np.testing.assert_allclose(covariance.deviations**2, np.diag(covariance.matrix))
    for deviation in covariance.deviations[:3]:
        assert f"{1e3 * deviation:.2g}" in repr(covariance)


def test_a_covariance_survives_json_and_pickling():
    covariance = _covariance(_POINT)
    plain = json.loads(json.dumps(covariance.as_dict(), allow_nan=False))
    np.testing.assert_array_equal(plain["matrix"], covariance.matrix)
    assert plain["blocks"] is None
    again = pickle.loads(pickle.dumps(covariance))
    np.testing.assert_array_equal(again.matrix, covariance.matrix)
    np.testing.assert_array_equal(again.reference_point, _POINT)
    assert not again.matrix.flags.writeable
    assert (again.pose, again.method) == (covariance.pose, covariance.method)
    assert math.isnan(again.blocks)


@pytest.mark.parametrize("matrix", [np.eye(3), np.full((6, 6), np.nan), np.full((6, 6), np.inf)])
def test_a_matrix_of_the_wrong_shape_or_not_finite_is_refused(matrix):
    with pytest.raises(InvalidInput, match="matrix must be a finite"):
        _covariance(matrix=matrix)


@pytest.mark.parametrize("point", [np.zeros(2), np.array([0.0, np.nan, 0.0])])
def test_a_point_of_the_wrong_shape_or_not_finite_is_refused(point):
    with pytest.raises(InvalidInput, match="point must be three finite coordinates"):
        _covariance().point_covariance(point)
    with pytest.raises(InvalidInput, match="reference_point must be three finite coordinates"):
        _covariance(point)
