import numpy as np
import pytest

from reference import gaussian_scores as reference
from reference.meeting import meet
from reference.samples import gaussians, yaw_pose
from scanlock.geometry.pose import Pose
from scanlock.models.gaussians import Gaussians
from scanlock.registration.verification.overlap import overlaps_and_score, self_score, slide_ratio


def _pair(seed=0):
    rng = np.random.default_rng(seed)
    return gaussians(rng, 40), gaussians(rng, 30)


def _agreement(target, source, pose):
    return overlaps_and_score(target, source, pose, (self_score(target), self_score(source)))


@pytest.mark.parametrize("seed", range(3))
def test_the_overlap_is_the_share_of_parts_that_meet(seed):
    target, source = _pair(seed)
    pose = Pose.from_step(np.array([1.0, -2.0, 0.5, 0.2, -0.1, 0.7]))
    moved = source.transformed(pose)
    met = meet(target.means, target.covariances, moved.means, moved.covariances, 9.0)
    squares = np.sqrt(source.counts)
    expected = squares[np.array(met)].sum() / squares.sum()
    assert 0.0 < expected < 1.0
    np.testing.assert_allclose(_agreement(target, source, pose)[0], expected, rtol=1e-12)


def test_scans_far_apart_do_not_overlap_and_do_not_correlate():
    target, source = _pair()
    away = yaw_pose(0.0, (1e3, 0.0, 0.0))
    assert _agreement(target, source, away) == (0.0, 0.0, 0.0)


def test_a_scan_overlaps_and_correlates_with_itself_wholly():
    target, _ = _pair()
    pose = Pose.from_step(np.array([1.0, -2.0, 0.5, 0.2, -0.1, 0.7]))
    moved = target.transformed(pose)
    overlap, target_overlap, score = _agreement(moved, target, pose)
    assert overlap == target_overlap == 1.0
    np.testing.assert_allclose(score, 1.0, rtol=1e-9)


def test_the_score_is_a_ratio_of_values_and_symmetric():
    target, source = _pair()
    pose = Pose.from_step(np.array([0.3, -0.2, 0.5, 0.2, -0.1, 0.7]))
    values = [
        reference.d2d_value(pose, target, source, power=0.25),
        reference.d2d_value(Pose.identity(), target, target, power=0.25),
        reference.d2d_value(Pose.identity(), source, source, power=0.25),
    ]
    there = _agreement(target, source, pose)
    np.testing.assert_allclose(there[2], -values[0] / np.sqrt(values[1] * values[2]), rtol=1e-10)
    back = _agreement(source, target, pose.inverse())
    np.testing.assert_allclose(back, (there[1], there[0], there[2]), rtol=1e-9)


def test_the_score_of_different_scans_is_below_one():
    # One wide Gaussian between two narrow ones: its score is the root of two.
    narrow = Gaussians.from_covariances(
        np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]),
        np.tile(0.01 * np.eye(3), (2, 1, 1)),
        np.array([10, 10]),
    )
    wide = Gaussians.from_covariances(np.zeros((1, 3)), 25.0 * np.eye(3)[None], np.array([10]))
    assert _agreement(narrow, wide, Pose.identity())[2] <= 1.0


def _posts(places):
    """Round posts of 0.2 m about places along a line in the x-y plane."""
    means = np.array(places, float)
    return Gaussians.from_covariances(
        means, np.tile(0.04 * np.eye(3), (len(means), 1, 1)), np.full(len(means), 30)
    )


@pytest.mark.parametrize("turn", [0.0, 1.1])
def test_a_fence_slid_by_its_spacing_is_a_rival(turn):
    pose = yaw_pose(turn, (3.0, -2.0, 1.0))
    fence = _posts([[2.0 * i, 0.0, 0.0] for i in range(10)])
    along, across = pose.rotation[:, 0].copy(), pose.rotation[:, 1].copy()
    moved = fence.transformed(pose)
    # Slid by one spacing, nine of the ten posts stand on another.
    assert slide_ratio(moved, fence, pose, along, 0.75) == pytest.approx(0.9, abs=1e-6)
    assert slide_ratio(moved, fence, pose, across, 0.75) < 0.03


def test_a_slide_counts_only_from_some_way_off():
    post = _posts([[5.0, 0.0, 0.0]])
    x = np.array([1.0, 0.0, 0.0])
    # Of a single post all that is left at 0.5 m is the flank of its own score.
    flank = np.exp(-0.5 * 0.5**2 / 0.08)
    assert slide_ratio(post, post, Pose.identity(), x, 0.5) == pytest.approx(flank)
    assert slide_ratio(post, post, Pose.identity(), x, 0.75) < flank


def test_where_nothing_meets_there_is_no_rivalry():
    post = _posts([[5.0, 0.0, 0.0]])
    away = yaw_pose(0.0, (0.0, 500.0, 0.0))
    assert np.isnan(slide_ratio(post, post, away, np.array([1.0, 0.0, 0.0]), 0.75))
