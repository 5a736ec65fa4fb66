import numpy as np
import pytest

from reference import gaussian_scores as reference
from reference.gaussian_overlap import overlaps
from reference.samples import gaussians, yaw_pose
from scanlock.geometry.pose import Pose
from scanlock.models.gaussians import Gaussians
from scanlock.registration.verification.overlap import (
    overlap_and_score,
    self_score,
    shifted_score_ratio,
)

_X = np.array([1.0, 0.0, 0.0])


def _pair(seed=0):
    rng = np.random.default_rng(seed)
    return gaussians(rng, 40), gaussians(rng, 30)


def _overlap_and_score(target, source, pose):
    return overlap_and_score(target, source, pose, (self_score(target), self_score(source)))


@pytest.mark.parametrize("seed", range(3))
def test_the_overlap_is_the_weighted_fraction_of_overlapping_gaussians(seed):
    target, source = _pair(seed)
    pose = Pose.from_step(np.array([1.0, -2.0, 0.5, 0.2, -0.1, 0.7]))
    moved = source.transformed(pose)
    selected = overlaps(target.means, target.covariances, moved.means, moved.covariances, 9.0)
    squares = np.sqrt(source.counts)
    expected = squares[np.array(selected)].sum() / squares.sum()
    assert 0.0 < expected < 1.0
    np.testing.assert_allclose(_overlap_and_score(target, source, pose)[0], expected, rtol=1e-12)


def test_distant_scans_have_no_overlap_and_no_score():
    target, source = _pair()
    away = yaw_pose(0.0, (1e3, 0.0, 0.0))
    assert _overlap_and_score(target, source, away) == (0.0, 0.0, 0.0)


def test_identical_scans_have_overlap_and_score_one():
    target, _ = _pair()
    pose = Pose.from_step(np.array([1.0, -2.0, 0.5, 0.2, -0.1, 0.7]))
    moved = target.transformed(pose)
    overlap, target_overlap, score = _overlap_and_score(moved, target, pose)
    assert overlap == target_overlap == 1.0
    np.testing.assert_allclose(score, 1.0, rtol=1e-9)


def test_the_score_is_normalised_by_the_self_scores_and_symmetric():
    target, source = _pair()
    pose = Pose.from_step(np.array([0.3, -0.2, 0.5, 0.2, -0.1, 0.7]))
    values = [
        reference.d2d_value(pose, target, source, power=0.25),
        reference.d2d_value(Pose.identity(), target, target, power=0.25),
        reference.d2d_value(Pose.identity(), source, source, power=0.25),
    ]
    forward = _overlap_and_score(target, source, pose)
    np.testing.assert_allclose(forward[2], -values[0] / np.sqrt(values[1] * values[2]), rtol=1e-10)
    backward = _overlap_and_score(source, target, pose.inverse())
    np.testing.assert_allclose(backward, (forward[1], forward[0], forward[2]), rtol=1e-9)


def test_the_score_is_capped_at_one():
    # One wide Gaussian between two narrow ones: without the cap the score is the root of two.
    narrow = Gaussians.from_covariances(
        np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]),
        np.tile(0.01 * np.eye(3), (2, 1, 1)),
        np.array([10, 10]),
    )
    wide = Gaussians.from_covariances(np.zeros((1, 3)), 25.0 * np.eye(3)[None], np.array([10]))
    assert _overlap_and_score(narrow, wide, Pose.identity())[2] <= 1.0


def _posts(points):
    """Round posts of 0.2 m."""
    means = np.array(points, float)
    return Gaussians.from_covariances(
        means, np.tile(0.04 * np.eye(3), (len(means), 1, 1)), np.full(len(means), 30)
    )


@pytest.mark.parametrize("yaw", [0.0, 1.1])
def test_a_fence_shifted_by_its_spacing_scores_nearly_as_well(yaw):
    pose = yaw_pose(yaw, (3.0, -2.0, 1.0))
    fence = _posts([[2.0 * i, 0.0, 0.0] for i in range(10)])
    along, across = pose.rotation[:, 0].copy(), pose.rotation[:, 1].copy()
    moved = fence.transformed(pose)
    # Shifted by one spacing, nine of the ten posts coincide with another.
    assert shifted_score_ratio(moved, fence, pose, along, 0.75) == pytest.approx(0.9, abs=1e-6)
    assert shifted_score_ratio(moved, fence, pose, across, 0.75) < 0.03


def test_shifts_below_the_minimum_do_not_count():
    post = _posts([[5.0, 0.0, 0.0]])
    # A single post shifted by 0.5 m has the tail of its own score.
    tail = np.exp(-0.5 * 0.5**2 / 0.08)
    assert shifted_score_ratio(post, post, Pose.identity(), _X, 0.5) == pytest.approx(tail)
    assert shifted_score_ratio(post, post, Pose.identity(), _X, 0.75) < tail


def test_the_shifted_score_ratio_is_nan_without_a_score_at_the_pose():
    post = _posts([[5.0, 0.0, 0.0]])
    away = yaw_pose(0.0, (0.0, 500.0, 0.0))
    assert np.isnan(shifted_score_ratio(post, post, away, _X, 0.75))
