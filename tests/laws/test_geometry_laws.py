"""Group axioms of poses, and laws of exponentials and logarithms."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation, log_rotation, rotation_angle

pytestmark = pytest.mark.slow

_directions = arrays(np.float64, 3, elements=st.floats(-1, 1)).filter(
    lambda v: np.linalg.norm(v) > 1e-3
)
# Formulas for rotations are inaccurate near zero, near pi and beyond it.
_angles = st.one_of(
    st.floats(0, 1e-3), st.floats(0, 3.1), st.floats(np.pi - 1e-6, np.pi), st.floats(4, 50)
)


@st.composite
def _vectors_of_rotation(draw):
    direction = draw(_directions)
    return draw(_angles) * direction / np.linalg.norm(direction)


@st.composite
def _poses(draw):
    translation = draw(arrays(np.float64, 3, elements=st.floats(-100, 100)))
    return Pose(exp_rotation(draw(_vectors_of_rotation())), translation)


def _assert_close(a, b):
    np.testing.assert_allclose(a.matrix, b.matrix, rtol=0, atol=1e-12)


@given(_poses(), _poses(), _poses())
def test_composition_is_associative(a, b, c):
    _assert_close((a @ b) @ c, a @ (b @ c))


@given(_poses())
def test_identity_is_neutral(pose):
    assert pose @ Pose.identity() == pose == Pose.identity() @ pose


@given(_poses())
def test_the_inverse_is_two_sided(pose):
    _assert_close(pose @ pose.inverse(), Pose.identity())
    _assert_close(pose.inverse() @ pose, Pose.identity())


@given(_poses(), _poses(), arrays(np.float64, (4, 3), elements=st.floats(-100, 100)))
def test_composition_applies_one_transform_after_the_other(a, b, points):
    np.testing.assert_allclose((a @ b).apply(points), a.apply(b.apply(points)), atol=1e-11)


@given(_poses(), _poses())
def test_distance_is_symmetric_and_invariant_to_a_common_transform(a, b):
    metres, radians = a.distance(b)
    np.testing.assert_allclose(b.distance(a), (metres, radians), atol=1e-11)
    moved = Pose.from_step(np.array([1.0, 2.0, 3.0, 0.4, 0.5, 0.6]))
    np.testing.assert_allclose((moved @ a).distance(moved @ b), (metres, radians), atol=1e-11)


@given(_poses(), arrays(np.float64, 6, elements=st.floats(-2, 2)))
def test_a_retraction_moves_points_in_the_target_frame(pose, step):
    points = np.array([[0.0, 0.0, 0.0], [1.0, -2.0, 3.0]])
    expected = pose.apply(points) @ exp_rotation(step[3:]).T + step[:3]
    np.testing.assert_allclose(pose.retract(step).apply(points), expected, atol=1e-12)


@given(_vectors_of_rotation())
def test_exp_gives_a_rotation_and_the_opposite_vector_its_inverse(vector):
    rotation = exp_rotation(vector)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(rotation) > 0
    np.testing.assert_allclose(exp_rotation(-vector), rotation.T, atol=1e-15)


@given(_vectors_of_rotation())
def test_exp_inverts_log_and_the_angle_is_at_most_pi(vector):
    rotation = exp_rotation(vector)
    np.testing.assert_allclose(exp_rotation(log_rotation(rotation)), rotation, atol=1e-14)
    assert 0 <= rotation_angle(rotation) <= np.pi + 1e-15


@given(_vectors_of_rotation(), _vectors_of_rotation())
def test_the_logarithm_rotates_with_the_frame(vector, frame):
    rotation, turn = exp_rotation(vector), exp_rotation(frame)
    rotated = turn @ rotation @ turn.T
    np.testing.assert_allclose(exp_rotation(turn @ log_rotation(rotation)), rotated, atol=1e-13)


@given(_poses())
def test_from_matrix_inverts_the_matrix_of_a_pose(pose):
    _assert_close(Pose.from_matrix(pose.matrix), pose)


@given(_poses(), _poses(), arrays(np.float64, (4, 3), elements=st.floats(-100, 100)))
def test_composition_and_application_are_associative(a, b, points):
    np.testing.assert_allclose((a @ b) @ points, a @ (b @ points), atol=1e-9)


@given(_poses())
def test_numpy_functions_accept_a_pose(pose):
    np.testing.assert_array_equal(np.asarray(pose), pose.matrix)
    np.testing.assert_allclose(np.linalg.inv(pose), pose.inverse().matrix, atol=1e-9)


@given(_poses())
def test_from_step_inverts_log(pose):
    assert Pose.from_step(pose.log()).is_close(pose, translation=1e-9, rotation=1e-7)


@given(_poses(), arrays(np.float64, 6, elements=st.floats(-1e-4, 1e-4)))
def test_the_adjoint_maps_small_steps_from_source_to_target(pose, step):
    before = pose @ Pose.from_step(step)
    after = Pose.from_step(pose.adjoint() @ step) @ pose
    assert before.is_close(after, translation=1e-5, rotation=1e-7)


@given(_poses(), _poses())
def test_a_perturbation_by_the_difference_gives_the_other_pose(a, b):
    assert b.perturbed(a.difference(b)).is_close(a, translation=1e-9, rotation=1e-6)


@given(_poses(), arrays(np.float64, 6, elements=st.floats(-2, 2)))
def test_a_perturbation_rotates_about_the_origin_of_the_source(pose, step):
    moved = pose.perturbed(step) @ np.zeros(3)
    np.testing.assert_allclose(moved, pose.translation + step[:3], atol=1e-12)


@given(_poses(), _poses())
def test_the_scaled_distance_combines_metres_and_radians(a, b):
    metres, radians = a.distance(b)
    # Two implementations of hypot differ in the last bit.
    expected = pytest.approx(np.hypot(metres, 20.0 * radians), rel=1e-15)
    assert a.scaled_distance(b, 20.0) == expected
