import numpy as np
import pytest

from reference import gaussian_scores as reference
from reference.meeting import meet
from reference.samples import gaussians, yaw_pose
from scanlock.geometry.pose import Pose
from scanlock.models.gaussians import Gaussians
from scanlock.objectives.quadratic import Quadratic
from scanlock.registration.agreement import overlap_and_score
from scanlock.registration.candidate import Candidate, second_best
from scanlock.registration.result import Status
from scanlock.registration.verdict import judge, weakest_direction
from scanlock.solvers.solution import Solution
from scanlock.solvers.stopping import StopReason

_UP = np.array([0.0, 0.0, 1.0])


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
    np.testing.assert_allclose(overlap_and_score(target, source, pose)[0], expected, rtol=1e-12)


def test_scans_far_apart_do_not_overlap_and_do_not_correlate():
    target, source = _pair()
    away = yaw_pose(0.0, (1e3, 0.0, 0.0))
    assert overlap_and_score(target, source, away) == (0.0, 0.0)


def test_a_scan_overlaps_and_correlates_with_itself_wholly():
    target, _ = _pair()
    pose = Pose.from_step(np.array([1.0, -2.0, 0.5, 0.2, -0.1, 0.7]))
    moved = target.transformed(pose)
    overlap, score = overlap_and_score(moved, target, pose)
    assert overlap == 1.0
    np.testing.assert_allclose(score, 1.0, rtol=1e-9)


def test_the_score_is_a_ratio_of_values_and_symmetric():
    target, source = _pair()
    pose = Pose.from_step(np.array([0.3, -0.2, 0.5, 0.2, -0.1, 0.7]))
    values = [
        reference.d2d_value(pose, target, source),
        reference.d2d_value(Pose.identity(), target, target),
        reference.d2d_value(Pose.identity(), source, source),
    ]
    _, score = overlap_and_score(target, source, pose)
    np.testing.assert_allclose(score, -values[0] / np.sqrt(values[1] * values[2]), rtol=1e-10)
    _, back = overlap_and_score(source, target, pose.inverse())
    np.testing.assert_allclose(back, score, rtol=1e-9)


def test_the_score_of_different_scans_is_below_one():
    # One wide Gaussian between two narrow ones: its score is the root of two.
    narrow = Gaussians.from_covariances(
        np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]),
        np.tile(0.01 * np.eye(3), (2, 1, 1)),
        np.array([10, 10]),
    )
    wide = Gaussians.from_covariances(np.zeros((1, 3)), 25.0 * np.eye(3)[None], np.array([10]))
    assert overlap_and_score(narrow, wide, Pose.identity())[1] <= 1.0


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
        status, sentence = judge(_solution(reason), overlap, score, 1.0, _UP)
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
    assert judge(_solution(reason), 1.0, 1.0, 1.0, _UP) == (status, reason.value)


def test_a_weakly_held_direction_is_degenerate_and_named():
    reason = StopReason.GRADIENT_SMALL
    direction = np.array([1.0, 0.0, 0.0])
    assert judge(_solution(reason), 1.0, 1.0, 0.2, direction)[0] is Status.OK
    status, sentence = judge(_solution(reason), 1.0, 1.0, 0.1, direction)
    assert status is Status.DEGENERATE
    assert "(1.00, 0.00, 0.00)" in sentence


@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_walls_hold_across_and_slide_along(turn):
    # Plates of 1 m that are 0.1 m thin: along x and z each axis is the longest.
    pose = Pose.from_step(np.array([3.0, -2.0, 1.0, 0.0, 0.0, turn]))
    plates = Gaussians.from_covariances(
        np.zeros((5, 3)), np.tile(np.diag([1.0, 0.01, 1.0]), (5, 1, 1)), np.full(5, 50)
    ).transformed(pose)
    hold, _ = weakest_direction(plates)
    assert hold < 1e-12
    # Poles, thin along x and y, hold what the plates let slide; height stays free.
    poles = Gaussians.from_covariances(
        np.zeros((5, 3)), np.tile(np.diag([0.01, 0.01, 1.0]), (5, 1, 1)), np.full(5, 50)
    ).transformed(pose)
    both = Gaussians.from_covariances(
        np.concatenate([plates.means, poles.means]),
        np.concatenate([plates.covariances, poles.covariances]),
        np.concatenate([plates.counts, poles.counts]),
    )
    hold, direction = weakest_direction(both)
    assert hold < 1e-12
    assert abs(direction[2]) > 1.0 - 1e-9


def test_round_gaussians_hold_every_way():
    some = Gaussians.from_covariances(
        np.zeros((4, 3)), np.tile(np.eye(3), (4, 1, 1)), np.full(4, 10)
    )
    assert weakest_direction(some)[0] == 1.0


def _candidate(overlap=0.8, score=0.5, violation=0.02):
    return Candidate(Pose.identity(), "heading search", overlap, score, violation)


@pytest.mark.parametrize(
    ("candidates", "status", "reason"),
    [
        ([_candidate()], Status.OK, "40%"),
        ([_candidate(overlap=0.2, score=0.2)], Status.LOW_OVERLAP, "only 40%"),
        ([_candidate(violation=0.3)], Status.LOW_OVERLAP, "30% of what each scan shows"),
        ([_candidate(), _candidate(score=0.1)], Status.OK, "40%"),
        ([_candidate(), _candidate(score=0.4)], Status.AMBIGUOUS, "80% as well"),
    ],
)
def test_candidates_are_judged_in_place_of_overlap_and_score(candidates, status, reason):
    # 0.4 times 0.1 alone would be far too little.
    found, sentence = judge(_solution(StopReason.STEP_SMALL), 0.4, 0.1, 1.0, _UP, candidates)
    assert found is status
    assert reason in sentence


def test_the_second_best_is_a_share_of_the_best():
    assert second_best([_candidate()]) == 0.0
    assert second_best([_candidate(), _candidate(score=0.2)]) == pytest.approx(0.4)
    assert np.isnan(second_best([]))
    assert np.isnan(second_best([_candidate(score=0.0)]))
