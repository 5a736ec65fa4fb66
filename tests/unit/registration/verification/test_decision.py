import math
from dataclasses import replace

import numpy as np
import pytest

from scanlock.geometry.pose import Pose
from scanlock.optimisation.solvers.criteria import StopReason
from scanlock.optimisation.solvers.problem import Quadratic
from scanlock.optimisation.solvers.solution import Solution
from scanlock.registration.verification.assessment import Assessment
from scanlock.registration.verification.candidate import Candidate, agreement_ratio
from scanlock.registration.verification.decision import (
    MAX_REFINEMENT_SHIFT,
    MAX_RUNNER_UP_RATIO,
    MAX_SHIFTED_SCORE_RATIO,
    MIN_PROBABILITY,
    decide_status,
)
from scanlock.registration.verification.metrics import Metrics
from scanlock.registration.verification.observability import DirectionObservability, Observability
from scanlock.registration.verification.status import Status


def _solution(reason=StopReason.STEP_SMALL):
    at = Quadratic(-1.0, np.zeros(6), np.eye(6))
    return Solution(Pose.identity(), at, reason, ())


def _observability(ratio=0.5):
    axes = np.eye(3)
    ratios = {"translation": (ratio, 0.8, 1.0), "rotation": (1.0, 1.0, 1.0)}
    return Observability(
        directions=tuple(
            DirectionObservability(kind=kind, axis=axes[i], ratio=ratios[kind][i], deviation=0.01)
            for kind in ratios
            for i in range(3)
        ),
        information=np.eye(6),
    )


def _assessment(observability=None, ratios=(math.nan, math.nan), **metrics):
    good = {
        "overlap": 0.8, "target_overlap": 0.7, "score": 0.5, "runner_up_ratio": 0.2,
        "outlier_ratio": 0.1, "refinement_shift": 0.02,
    }  # fmt: skip
    return Assessment(
        metrics=Metrics(**{**good, **metrics}),
        observability=observability or _observability(),
        runner_up_ratio=ratios[0],
        shifted_score_ratio=ratios[1],
    )


@pytest.mark.parametrize("reason", [StopReason.GRADIENT_SMALL, StopReason.STEP_SMALL])
def test_a_converged_pose_is_ok_from_the_minimum_probability(reason):
    below = math.nextafter(MIN_PROBABILITY, 0.0)
    for probability, expected in (
        (1.0, Status.OK),
        (MIN_PROBABILITY, Status.OK),
        (below, Status.UNVERIFIED),
        (0.0, Status.UNVERIFIED),
    ):
        status, sentence = decide_status(_solution(reason), _assessment(), probability)
        assert status is expected
        assert "80%" in sentence
        assert "0.50" in sentence


@pytest.mark.parametrize(
    ("reason", "status"),
    [
        (StopReason.EMPTY_OBJECTIVE, Status.NO_CORRESPONDENCES),
        (StopReason.ITERATION_LIMIT, Status.NOT_CONVERGED),
    ],
)
def test_a_solver_that_did_not_converge_is_never_ok(reason, status):
    found, sentence = decide_status(_solution(reason), _assessment(), 1.0)
    assert found is status
    assert sentence.startswith(reason.value)


def test_an_unconstrained_direction_is_degenerate_and_named():
    status, sentence = decide_status(_solution(), _assessment(_observability(ratio=0.001)), 1.0)
    assert status is Status.DEGENERATE
    assert "forward" in sentence
    constrained = _assessment(_observability(ratio=0.1))
    assert decide_status(_solution(), constrained, 1.0)[0] is Status.OK


@pytest.mark.parametrize(
    "metrics",
    [{"outlier_ratio": 0.4}, {"free_space_violation": 0.3}, {"outlier_ratio": math.nan}],
)
def test_inconsistent_scans_are_unverified_instead_of_degenerate(metrics):
    assessment = _assessment(_observability(ratio=0.001), **metrics)
    status, sentence = decide_status(_solution(), assessment, 0.2)
    assert status is Status.UNVERIFIED
    assert "likely wrong" in sentence


def test_a_pose_without_shared_planes_has_low_overlap():
    metrics = Metrics(overlap=0.9, target_overlap=0.9, score=0.9)
    assessment = Assessment(metrics=metrics, observability=None)
    status, sentence = decide_status(_solution(), assessment, 1.0)
    assert status is Status.LOW_OVERLAP
    assert "too few common surfaces" in sentence


@pytest.mark.parametrize("name", ["overlap", "target_overlap"])
def test_a_pose_without_overlapping_clusters_has_low_overlap(name):
    status, sentence = decide_status(_solution(), _assessment(**{name: 0.04}), 1.0)
    assert status is Status.LOW_OVERLAP
    assert "too little overlap" in sentence


def test_a_pose_that_refinement_would_move_is_inaccurate():
    above = math.nextafter(MAX_REFINEMENT_SHIFT, 1.0)
    for refinement_shift, probability, expected in (
        (MAX_REFINEMENT_SHIFT, 1.0, Status.OK),
        (above, 1.0, Status.INACCURATE),
        (above, 0.5, Status.INACCURATE),
        (above, 0.1, Status.UNVERIFIED),
    ):
        assessment = _assessment(refinement_shift=refinement_shift)
        assert decide_status(_solution(), assessment, probability)[0] is expected
    assert "0.30 m" in decide_status(_solution(), _assessment(refinement_shift=0.3), 1.0)[1]


def test_a_close_runner_up_is_ambiguous():
    assessment = _assessment(ratios=(0.95, math.nan), runner_up_ratio=0.95)
    status, sentence = decide_status(_solution(), assessment, 1.0)
    assert status is Status.AMBIGUOUS
    assert "95%" in sentence
    # The ranking of the search decides, not the agreements; shifts have a threshold of their own.
    for ratios, expected in (
        ((MAX_RUNNER_UP_RATIO, MAX_SHIFTED_SCORE_RATIO), Status.OK),
        ((math.nextafter(MAX_RUNNER_UP_RATIO, 1.0), 0.0), Status.AMBIGUOUS),
        ((0.0, math.nextafter(MAX_SHIFTED_SCORE_RATIO, 1.0)), Status.AMBIGUOUS),
        ((math.nan, math.nan), Status.OK),
    ):
        assessment = _assessment(ratios=ratios, runner_up_ratio=0.95)
        assert decide_status(_solution(), assessment, 1.0)[0] is expected


def _candidate(score=0.5):
    return Candidate(
        target_from_source=Pose.identity(), proposed_by="prior", overlap=0.8, target_overlap=0.7,
        score=score, free_space_violation=0.02,
    )  # fmt: skip


def test_the_agreement_ratio_compares_the_runner_up_with_the_best():
    assert agreement_ratio([_candidate()]) == 0.0
    assert agreement_ratio([_candidate(), _candidate(score=0.2)]) == pytest.approx(0.4)
    assert np.isnan(agreement_ratio([]))
    assert np.isnan(agreement_ratio([_candidate(score=0.0)]))


def _other(metres, degrees, probability):
    angle = math.radians(degrees)
    pose = Pose.from_step(np.array([metres, 0.0, 0.0, 0.0, 0.0, angle]))
    return Candidate(
        target_from_source=pose, proposed_by="BEV correlation", overlap=0.3, target_overlap=0.3,
        score=0.2, free_space_violation=0.0, probability=probability,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("metres", "degrees", "probability", "expected"),
    [
        (4.0, 0.0, 0.95, Status.AMBIGUOUS),
        (0.0, 180.0, 0.95, Status.AMBIGUOUS),
        (4.0, 0.0, 0.85, Status.OK),
        (0.8, 3.0, 0.99, Status.OK),
        (4.0, 0.0, math.nan, Status.OK),
    ],
)
def test_another_verified_pose_is_a_other(metres, degrees, probability, expected):
    candidates = (_other(0.0, 0.0, 0.99), _other(metres, degrees, probability))
    solution = replace(_solution(), candidates=candidates)
    status, sentence = decide_status(solution, _assessment(), 0.99)
    assert status is expected
    if expected is Status.AMBIGUOUS:
        assert f"{metres:.2f} m and {degrees:.1f} degrees away" in sentence


@pytest.mark.parametrize(
    ("difference", "deviation", "expected"),
    [
        (0.0005, 0.0001, Status.OK),
        (0.008, 0.0007, Status.UNVERIFIED),
        (-0.02, 0.001, Status.UNVERIFIED),
        (0.008, 0.003, Status.OK),
        (math.nan, math.nan, Status.OK),
    ],
)
def test_scans_of_different_scale_are_not_ok(difference, deviation, expected):
    assessment = _assessment(scale_difference=difference, scale_deviation=deviation)
    status, sentence = decide_status(_solution(), assessment, 0.99)
    assert status is expected
    assert ("scales of the scans" in sentence) is (expected is Status.UNVERIFIED)
