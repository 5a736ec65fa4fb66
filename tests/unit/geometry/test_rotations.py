import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from scanlock.geometry.rotations import (
    exp_rotation,
    hat,
    log_rotation,
    nearest_rotation,
    quaternion_from_rotation,
    rotation_angle,
    rotation_onto_z,
)

_ANGLES = [0.0, 1e-300, 1e-12, 1e-8, 9.9e-5, 1.01e-4, 1e-3, 0.5, 2.0, 3.1, np.pi - 1e-9, np.pi]


def _axes(count):
    directions = np.random.default_rng(5).normal(size=(count, 3))
    corners = np.vstack([np.eye(3), -np.eye(3), [[1, 1, 0], [1, 1, 1], [-1, 1, -1]]])
    axes = np.vstack([corners, directions])
    return axes / np.linalg.norm(axes, axis=1, keepdims=True)


@pytest.mark.parametrize("offset", [0.0, 1e-12, 1e-6, 0.1])
def test_any_direction_is_rotated_onto_z(offset):
    for axis in (*_axes(20), np.array([np.sin(offset), 0.0, -np.cos(offset)])):
        rotation = rotation_onto_z(axis)
        np.testing.assert_allclose(rotation @ axis, [0.0, 0.0, 1.0], atol=1e-14)
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)
        assert np.linalg.det(rotation) == pytest.approx(1.0)
        if axis[2] >= 0.0:
            assert rotation_angle(rotation) == pytest.approx(np.arccos(axis[2]), abs=1e-7)


def test_hat_is_the_cross_product():
    a, b = np.random.default_rng(0).normal(size=(2, 3))
    np.testing.assert_allclose(hat(a) @ b, np.cross(a, b), rtol=1e-15)
    np.testing.assert_array_equal(hat(a), -hat(a).T)


@pytest.mark.parametrize("angle", [*_ANGLES, 4.0, 2 * np.pi, 100.0, 1e4])
def test_exp_agrees_with_scipy_from_zero_to_many_revolutions(angle):
    for axis in _axes(10):
        expected = Rotation.from_rotvec(angle * axis).as_matrix()
        # The sine of a large angle is known only to the rounding of the angle itself.
        atol = 1.5e-15 + 4e-16 * angle
        np.testing.assert_allclose(exp_rotation(angle * axis), expected, rtol=0, atol=atol)


@pytest.mark.parametrize("angle", _ANGLES)
def test_log_inverts_exp(angle):
    for axis in _axes(10):
        vector = log_rotation(exp_rotation(angle * axis))
        if angle == np.pi:
            # A rotation by pi has two logarithms, and rounding decides between them.
            vector = vector * np.sign(vector @ axis)
        np.testing.assert_allclose(vector, angle * axis, rtol=0, atol=1e-15 + 1e-14 * angle)


@pytest.mark.parametrize("angle", [1e-15, 1e-12, 1e-9, 5e-5])
def test_small_rotations_keep_their_relative_accuracy(angle):
    axis = np.array([0.6, 0.0, -0.8])
    vector = log_rotation(exp_rotation(angle * axis))
    np.testing.assert_allclose(vector, angle * axis, rtol=0, atol=1e-13 * angle)
    assert rotation_angle(exp_rotation(angle * axis)) == pytest.approx(angle, rel=1e-13)


@pytest.mark.parametrize("difference", [1e-3, 1e-6, 1e-9, 1e-12])
def test_angles_just_below_pi_keep_their_accuracy(difference):
    for axis in _axes(10):
        rotation = Rotation.from_rotvec((np.pi - difference) * axis).as_matrix()
        assert np.pi - rotation_angle(rotation) == pytest.approx(difference, abs=2e-15)


def test_log_returns_the_shorter_rotation_for_an_angle_above_pi():
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    vector = log_rotation(exp_rotation(4.0 * axis))
    np.testing.assert_allclose(vector, (4.0 - 2 * np.pi) * axis, atol=1e-14)


@pytest.mark.parametrize("angle", _ANGLES)
def test_quaternion_agrees_with_scipy_and_has_no_negative_scalar(angle):
    for axis in _axes(10):
        rotation = Rotation.from_rotvec(angle * axis)
        quaternion = quaternion_from_rotation(rotation.as_matrix())
        expected = rotation.as_quat(scalar_first=True)
        assert quaternion[0] >= 0
        assert np.linalg.norm(quaternion) == pytest.approx(1.0, abs=1e-15)
        assert abs(quaternion @ expected) == pytest.approx(1.0, abs=1e-15)


def test_nearest_rotation_does_not_change_rotations():
    for axis in _axes(10):
        rotation = exp_rotation(1.2 * axis)
        np.testing.assert_allclose(nearest_rotation(rotation), rotation, rtol=0, atol=2e-15)


def test_nearest_rotation_is_closer_than_rotations_around_it():
    rng = np.random.default_rng(3)
    noisy = exp_rotation(rng.normal(size=3)) + 0.1 * rng.normal(size=(3, 3))
    for matrix in (noisy, -np.eye(3), noisy @ np.diag([1.0, 0.8, -0.3])):
        nearest = nearest_rotation(matrix)
        np.testing.assert_allclose(nearest @ nearest.T, np.eye(3), atol=1e-15)
        assert np.linalg.det(nearest) == pytest.approx(1.0)
        best = np.linalg.norm(nearest - matrix)
        for step in rng.normal(scale=0.3, size=(200, 3)):
            assert np.linalg.norm(exp_rotation(step) @ nearest - matrix) >= best - 1e-12
