import numpy as np
import pytest

from reference import gaussian_scores as reference
from reference.meeting import meet
from reference.samples import gaussians, yaw_pose
from scanlock.geometry.pose import Pose
from scanlock.models.gaussians import Gaussians
from scanlock.objectives.quadratic import Quadratic
from scanlock.registration.result import Status
from scanlock.registration.verdict import gaussian_overlap, judge, score_correlation
from scanlock.solvers.newton import Solution
from scanlock.solvers.stopping import StopReason


def _pair(seed=0):
    rng = np.random.default_rng(seed)
    return gaussians(rng, 40), gaussians(rng, 30)


def _solution(reason):
    at = Quadratic(-1.0, np.zeros(6), np.eye(6))
    return Solution(Pose.identity(), at, reason, ())


@pytest.mark.parametrize("seed", range(3))
def test_the_overlap_is_the_share_of_points_whose_parts_meet(seed):
    target, source = _pair(seed)
    pose = Pose.from_step(np.array([1.0, -2.0, 0.5, 0.2, -0.1, 0.7]))
    moved = source.transformed(pose)
    met = meet(target.means, target.covariances, moved.means, moved.covariances, 9.0)
    expected = source.counts[np.array(met)].sum() / source.counts.sum()
    assert 0.0 < expected < 1.0
    np.testing.assert_allclose(gaussian_overlap(target, source, pose), expected, rtol=1e-12)


def test_scans_far_apart_do_not_overlap_and_do_not_correlate():
    target, source = _pair()
    away = yaw_pose(0.0, (1e3, 0.0, 0.0))
    assert gaussian_overlap(target, source, away) == 0.0
    assert score_correlation(target, source, away) == 0.0


def test_a_scan_overlaps_and_correlates_with_itself_wholly():
    target, _ = _pair()
    pose = Pose.from_step(np.array([1.0, -2.0, 0.5, 0.2, -0.1, 0.7]))
    moved = target.transformed(pose)
    assert gaussian_overlap(moved, target, pose) == 1.0
    np.testing.assert_allclose(score_correlation(moved, target, pose), 1.0, rtol=1e-9)


def test_the_score_is_a_ratio_of_values_and_symmetric():
    target, source = _pair()
    pose = Pose.from_step(np.array([0.3, -0.2, 0.5, 0.2, -0.1, 0.7]))
    values = [
        reference.d2d_value(pose, target, source),
        reference.d2d_value(Pose.identity(), target, target),
        reference.d2d_value(Pose.identity(), source, source),
    ]
    score = score_correlation(target, source, pose)
    np.testing.assert_allclose(score, -values[0] / np.sqrt(values[1] * values[2]), rtol=1e-10)
    np.testing.assert_allclose(score_correlation(source, target, pose.inverse()), score, rtol=1e-9)


def test_the_score_of_different_scans_is_below_one():
    # One wide Gaussian between two narrow ones: its score is the root of two.
    narrow = Gaussians(
        np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]),
        np.tile(0.01 * np.eye(3), (2, 1, 1)),
        np.array([10, 10]),
    )
    wide = Gaussians(np.zeros((1, 3)), 25.0 * np.eye(3)[None], np.array([10]))
    assert score_correlation(narrow, wide, Pose.identity()) <= 1.0


@pytest.mark.parametrize("reason", [StopReason.GRADIENT_SMALL, StopReason.STEP_SMALL])
def test_a_converged_solution_is_judged_by_overlap_and_score_together(reason):
    for overlap, score, expected in (
        (1.0, 1.0, Status.OK),
        (0.9, 0.9, Status.OK),
        (1.0, 0.2, Status.LOW_OVERLAP),
        (0.2, 1.0, Status.LOW_OVERLAP),
        (0.5, 0.5, Status.LOW_OVERLAP),
        (0.0, 0.0, Status.LOW_OVERLAP),
    ):
        status, sentence = judge(_solution(reason), overlap, score)
        assert status is expected
        assert f"{overlap:.0%}" in sentence
        assert f"{score:.2f}" in sentence


@pytest.mark.parametrize(
    ("reason", "status"),
    [
        (StopReason.NO_SUPPORT, Status.NO_SUPPORT),
        (StopReason.ITERATION_LIMIT, Status.NOT_CONVERGED),
    ],
)
def test_a_solver_that_gave_up_is_never_ok(reason, status):
    assert judge(_solution(reason), 1.0, 1.0) == (status, reason.value)
