import numpy as np
import pytest

from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.geometry.rigid_fit import PairMoments, fit_arun, fit_horn, fit_yaw

POSE = Pose.from_step(np.array([3.0, -2.0, 0.5, 0.3, -0.2, 1.1]))
_both = pytest.mark.parametrize("fit", [fit_arun, fit_horn])
_all = pytest.mark.parametrize("fit", [fit_arun, fit_horn, fit_yaw])


def _pairs(rng, count=30, noise=0.0):
    source = rng.normal(0.0, 10.0, (count, 3))
    return POSE.apply(source) + rng.normal(0.0, noise, source.shape), source


@_both
def test_noise_free_correspondences_give_the_pose_from_source_to_target(fit):
    target, source = _pairs(np.random.default_rng(0))
    assert fit(target, source).is_close(POSE, translation=1e-12, rotation=1e-13)


def test_the_printed_formulas_give_the_pose_from_model_to_data():
    # Madhavan and Messina 2003, section 2.1: H, R and T with p of the model and q of the data.
    p, q = _pairs(np.random.default_rng(1))
    u, _, vt = np.linalg.svd((p - p.mean(0)).T @ (q - q.mean(0)))
    rotation = vt.T @ u.T
    printed = Pose(rotation, q.mean(0) - rotation @ p.mean(0))
    assert printed.is_close(POSE.inverse(), translation=1e-12, rotation=1e-13)
    assert fit_arun(p, q).is_close(printed.inverse(), translation=1e-12, rotation=1e-13)


@_both
def test_three_points_and_points_in_a_plane_are_enough(fit):
    rng = np.random.default_rng(2)
    for count in (3, 40):
        source = np.column_stack([rng.normal(0.0, 5.0, (count, 2)), np.zeros(count)])
        found = fit(POSE.apply(source), source)
        assert found.is_close(POSE, translation=1e-12, rotation=1e-13)


@_both
def test_a_reflection_is_never_returned(fit):
    rng = np.random.default_rng(3)
    source = rng.normal(0.0, 1.0, (20, 3)) * [5.0, 4.0, 0.01]
    mirrored = source * [1.0, 1.0, -1.0]
    found = fit(mirrored, source)
    np.testing.assert_allclose(np.linalg.det(found.rotation), 1.0, rtol=1e-12)
    assert found.is_close(Pose.identity(), translation=0.01, rotation=0.01)


@_both
def test_the_product_without_the_sign_of_the_determinant_is_a_reflection(fit):
    rng = np.random.default_rng(3)
    source = rng.normal(0.0, 1.0, (20, 3)) * [5.0, 4.0, 0.01]
    target = source * [1.0, 1.0, -1.0]
    u, _, vt = np.linalg.svd((source - source.mean(0)).T @ (target - target.mean(0)))
    assert np.linalg.det(vt.T @ u.T) < 0.0 < np.linalg.det(fit(target, source).rotation)


@_all
def test_no_other_pose_fits_noisy_weighted_correspondences_better(fit):
    rng = np.random.default_rng(4)
    target, source = _pairs(rng, noise=0.5)
    weights = rng.uniform(0.0, 1.0, len(source))
    best = fit(target, source, weights)

    def cost(pose):
        return weights @ ((target - pose.apply(source)) ** 2).sum(axis=1)

    free = [1, 1, 1, 0, 0, 1] if fit is fit_yaw else np.ones(6)
    for _ in range(50):
        assert cost(best.retract(rng.normal(0.0, 1e-3, 6) * free)) > cost(best)


@_all
def test_a_zero_weight_removes_a_correspondence_and_an_integer_weight_repeats_it(fit):
    rng = np.random.default_rng(5)
    target, source = _pairs(rng, 12, noise=0.3)
    weights = np.array([0.0, 1.0, 2.0] * 4)
    rows = np.repeat(np.arange(12), weights.astype(int))
    expected = fit(target[rows], source[rows])
    assert fit(target, source, weights).is_close(expected, translation=1e-12, rotation=1e-12)


@_all
def test_correspondences_far_from_the_origin_keep_their_accuracy(fit):
    rng = np.random.default_rng(6)
    target, source = _pairs(rng, noise=0.1)
    near = fit(target, source)
    shift = np.array([5e5, 5e6, 100.0])
    moved = fit(target + shift, source + shift)
    difference = moved.apply(source + shift) - shift - near.apply(source)
    assert np.abs(difference).max() < 1e-7


def test_fit_yaw_gives_the_pose_of_a_level_sensor():
    source = np.random.default_rng(7).normal(0.0, 10.0, (30, 3))
    level = Pose.from_step(np.array([1.0, 2.0, 0.3, 0.0, 0.0, 2.5]))
    found = fit_yaw(level.apply(source), source)
    assert found.is_close(level, translation=1e-12, rotation=1e-13)
    flat = fit_yaw(level.apply(source), source, translation="xy")
    np.testing.assert_allclose(flat.translation, [1.0, 2.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(flat.rotation, level.rotation, atol=1e-13)


_LINE = np.arange(10.0)[:, None] * [1.0, 2.0, -1.0]


@_both
@pytest.mark.parametrize(
    "source", [_LINE, _LINE[:2], np.ones((5, 3)), np.zeros((1, 3))], ids=["line", "2", "point", "1"]
)
def test_correspondences_that_do_not_determine_the_rotation_are_rejected(fit, source):
    assert not PairMoments.of(source, source).constrains_rotation
    with pytest.raises(InvalidInput, match="target and source must determine the rotation, got"):
        fit(POSE.apply(source), source)


def test_two_rotations_that_fit_equally_are_rejected():
    # A mirrored cube: all rotations that swap two axes have the same error.
    source = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1.0]])
    for fit in (fit_arun, fit_horn):
        with pytest.raises(
            InvalidInput, match="target and source must determine the rotation, got"
        ):
            fit(-source, source)


def test_a_line_determines_its_yaw_unless_it_is_vertical():
    level = Pose.from_step(np.array([1.0, 2.0, 0.3, 0.0, 0.0, 2.5]))
    assert fit_yaw(level.apply(_LINE), _LINE).is_close(level, translation=1e-11, rotation=1e-12)
    vertical = _LINE * [0.0, 0.0, 1.0]
    with pytest.raises(InvalidInput, match="determine the rotation about z, got 10 pairs"):
        fit_yaw(vertical, vertical)


@_all
@pytest.mark.parametrize(
    ("target", "source", "weights", "message"),
    [
        (np.zeros((4, 3)), np.zeros((5, 3)), None, "same shape"),
        (np.zeros((4, 2)), np.zeros((4, 2)), None, "same shape"),
        (np.eye(3), np.eye(3), np.ones(2), r"shape \(3,\), got \(2,\)"),
        (np.eye(3), np.eye(3), np.zeros(3), "not all zero"),
        (np.eye(3), np.eye(3), np.array([1.0, -0.5, 1.0]), "non-negative"),
        (np.eye(3), np.eye(3), np.array([1.0, np.nan, 1.0]), "finite"),
        (np.zeros((0, 3)), np.zeros((0, 3)), None, "not all zero"),
    ],
)
def test_invalid_correspondences_are_rejected(fit, target, source, weights, message):
    with pytest.raises(InvalidInput, match=message):
        fit(target, source, weights)
