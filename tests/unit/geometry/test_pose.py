import copy
import pickle

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation, hat


def _pose(seed, scale=5.0):
    rng = np.random.default_rng(seed)
    return Pose(exp_rotation(rng.normal(size=3)), scale * rng.normal(size=3))


def test_a_pose_rotates_then_translates():
    quarter_turn = Pose([[0, -1, 0], [1, 0, 0], [0, 0, 1]], [10, 20, 30])
    np.testing.assert_array_equal(quarter_turn.apply([1, 2, 3]), [8, 21, 33])
    np.testing.assert_array_equal(quarter_turn.apply([[1, 2, 3], [0, 0, 0]])[1], [10, 20, 30])


def test_apply_keeps_the_leading_shape():
    points = np.random.default_rng(0).normal(size=(4, 5, 3))
    moved = _pose(1).apply(points)
    assert moved.shape == (4, 5, 3)
    np.testing.assert_allclose(moved[2, 3], _pose(1).apply(points[2, 3]), rtol=1e-15)


@pytest.mark.parametrize("points", [np.zeros((5, 4)), np.zeros((3, 2)), np.float64(1.0)])
def test_apply_rejects_points_that_are_not_three_dimensional(points):
    with pytest.raises(InvalidInput, match=r"points must have shape \(\.\.\., 3\), got"):
        Pose.identity().apply(points)


def test_pose_agrees_with_scipys_rigid_transform():
    a, b = _pose(1), _pose(2)
    transform_a, transform_b = (
        RigidTransform.from_matrix(a.matrix),
        RigidTransform.from_matrix(b.matrix),
    )
    points = np.random.default_rng(3).normal(size=(20, 3))
    np.testing.assert_allclose(a.apply(points), transform_a.apply(points), atol=1e-14)
    np.testing.assert_allclose((a @ b).matrix, (transform_a * transform_b).as_matrix(), atol=1e-14)
    np.testing.assert_allclose(a.inverse().matrix, transform_a.inv().as_matrix(), atol=1e-14)


def test_a_step_is_translation_first_and_needs_no_v_matrix():
    rho, phi = np.array([0.4, -1.0, 2.0]), np.array([0.3, 0.1, -0.7])
    pose = Pose.from_step(np.concatenate([rho, phi]))
    # SciPy puts the rotation first, and its translation is V(phi) times the last three numbers.
    # A pure rotation and a pure translation are the same in both.
    turn = RigidTransform.from_exp_coords(np.concatenate([phi, np.zeros(3)]))
    shift = RigidTransform.from_exp_coords(np.concatenate([np.zeros(3), rho]))
    np.testing.assert_allclose(pose.matrix, (shift * turn).as_matrix(), atol=1e-15)
    assert not np.allclose(
        pose.matrix, RigidTransform.from_exp_coords(np.concatenate([phi, rho])).as_matrix()
    )


@pytest.mark.parametrize("seed", range(3))
def test_the_jacobian_of_a_retraction_is_identity_and_minus_hat(seed):
    pose = _pose(seed)
    point = np.random.default_rng(seed + 10).normal(size=3) * 30
    moved = pose.apply(point)
    expected = np.hstack([np.eye(3), -hat(moved)])
    step = 1e-5
    measured = np.column_stack(
        [
            (pose.retract(step * unit).apply(point) - pose.retract(-step * unit).apply(point))
            / (2 * step)
            for unit in np.eye(6)
        ]
    )
    np.testing.assert_allclose(measured, expected, atol=1e-7)


def test_thousands_of_retractions_remain_orthonormal():
    pose = Pose.identity()
    step = np.array([0.01, 0.0, 0.0, 0.02, -0.01, 0.03])
    for _ in range(2000):
        pose = pose.retract(step)
    residual = np.abs(pose.rotation @ pose.rotation.T - np.eye(3)).max()
    assert residual < 2e-15
    expected = Rotation.from_rotvec(2000 * step[3:]).as_matrix()
    np.testing.assert_allclose(pose.rotation, expected, atol=1e-12)


def test_distance_is_metres_and_radians():
    a = _pose(4)
    b = Pose(a.rotation @ exp_rotation(np.array([0, 0, 0.25])), a.translation + np.array([0, 3, 4]))
    metres, radians = a.distance(b)
    assert metres == pytest.approx(5.0)
    assert radians == pytest.approx(0.25)
    assert a.is_close(b, translation=5.1, rotation=0.26)
    assert not a.is_close(b, translation=4.9, rotation=0.26)
    assert not a.is_close(b, translation=5.1, rotation=0.24)


def test_from_matrix_accepts_four_or_three_rows_of_any_array_like():
    pose = _pose(5)
    for matrix in (
        pose.matrix,
        pose.matrix[:3],
        pose.matrix.tolist(),
        np.asfortranarray(pose.matrix),
    ):
        assert Pose.from_matrix(matrix).is_close(pose, translation=1e-15, rotation=1e-15)


@pytest.mark.parametrize(("digits", "tolerance"), [(6, 2e-6), (4, 2e-4), (3, 2e-3)])
def test_from_matrix_corrects_a_matrix_printed_with_few_digits(digits, tolerance):
    pose = _pose(6)
    corrected = Pose.from_matrix(np.round(pose.matrix, digits))
    np.testing.assert_allclose(corrected.rotation @ corrected.rotation.T, np.eye(3), atol=1e-15)
    assert corrected.is_close(pose, translation=tolerance, rotation=tolerance)


def _scaled(factor):
    matrix = _pose(7).matrix
    matrix[:3, :3] *= factor
    return matrix


def _with_last_row(row):
    matrix = _pose(7).matrix
    matrix[3] = row
    return matrix


@pytest.mark.parametrize(
    ("matrix", "message"),
    [
        (
            _scaled(1.05),
            r"nearest rotation by 0.0\d+ \(at most 0.01 .*: it is scaled by 1.05; divide",
        ),
        (np.diag([1.0, 1.0, -1.0, 1.0]), "rotation by 2 .* it is mirrored; swap or negate an axis"),
        (np.array([[1, 0.1, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]), "it is sheared"),
        (np.zeros((4, 4)), "last row"),
        (np.zeros((3, 4)), "it is scaled by 0;"),
        (_with_last_row([0, 0, 0, 2]), r"last row of pose must be 0 0 0 1, got \[0.0, 0.0, 0.0"),
        (_pose(7).matrix.T, "last row of pose .*; transpose it"),
        (np.eye(3), r"must have shape \(4, 4\) or \(3, 4\), got \(3, 3\)"),
        (np.full((4, 4), np.nan), "must be finite"),
        (np.eye(4) * (1 + 0j), "must hold real numbers: dtype complex128"),
        ([["a"] * 4] * 4, "must hold real numbers"),
        ([[1, 2], [3]], "must hold real numbers"),
        (None, "must hold real numbers"),
    ],
)
def test_from_matrix_rejects_matrices_that_are_not_poses(matrix, message):
    with pytest.raises(InvalidInput, match=message):
        Pose.from_matrix(matrix)
    with pytest.raises(InvalidInput, match="start"):
        Pose.from_matrix(matrix, "start")


@pytest.mark.parametrize(
    ("rotation", "translation", "message"),
    [
        (np.eye(4), np.zeros(3), r"rotation must have shape \(3, 3\), got \(4, 4\)"),
        (np.eye(3), np.zeros((3, 1)), r"translation must have shape \(3,\), got \(3, 1\)"),
        (np.eye(3), [0, np.inf, 0], "translation must be finite"),
        (np.diag([np.nan, 1, 1]), np.zeros(3), "rotation must be finite"),
        (np.diag([1.0, 1.0, -1.0]), np.zeros(3), r"orthonormal with determinant \+1"),
        (2 * np.eye(3), np.zeros(3), "orthonormal .* Pose.from_matrix corrects"),
        (np.eye(3), ["x", "y", "z"], "translation must hold real numbers"),
    ],
)
def test_the_constructor_rejects_invalid_rotations_and_translations(rotation, translation, message):
    with pytest.raises(InvalidInput, match=message):
        Pose(rotation, translation)


@pytest.mark.parametrize("step", [np.zeros(5), np.zeros(7), np.zeros((2, 3)), [np.nan] * 6])
def test_a_step_has_six_finite_numbers(step):
    with pytest.raises(InvalidInput, match="step must"):
        Pose.from_step(step)


def test_a_pose_owns_read_only_arrays():
    rotation, translation = np.eye(3), np.zeros(3)
    pose = Pose(rotation, translation)
    rotation[0, 0] = 7.0
    translation[0] = 7.0
    assert pose == Pose.identity()
    for array in (pose.rotation, pose.translation):
        assert array.flags.c_contiguous
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0
    pose.matrix[0, 0] = 7.0
    assert pose == Pose.identity()


@pytest.mark.parametrize(
    "make", [lambda p: pickle.loads(pickle.dumps(p)), copy.copy, copy.deepcopy]
)
def test_copies_are_equal_and_read_only_again(make):
    pose = _pose(8)
    twin = make(pose)
    assert twin == pose
    assert not twin.rotation.flags.writeable
    assert not twin.translation.flags.writeable


def test_equal_poses_have_equal_hashes_for_either_sign_of_zero():
    inverse = Pose.identity().inverse()
    assert inverse == Pose.identity() == Pose(np.eye(3), [-0.0, -0.0, 0.0])
    assert len({inverse, Pose.identity(), Pose(np.eye(3), [-0.0, -0.0, 0.0])}) == 1


def test_different_poses_and_other_things_are_not_equal():
    assert _pose(1) != _pose(2)
    assert _pose(1) != "a pose"
