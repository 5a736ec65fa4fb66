import math

import numpy as np
import pytest

from scanlock.geometry.pose import Pose
from scanlock.optimisation.solvers.criteria import StopReason
from scanlock.optimisation.solvers.problem import Quadratic
from scanlock.optimisation.solvers.solution import Solution
from scanlock.registration.verification.assessment import Assessment
from scanlock.registration.verification.candidate import Candidate, runner_up_ratio
from scanlock.registration.verification.decision import (
    MAX_REFINEMENT_SHIFT,
    MAX_RUNNER_UP_RATIO,
    MAX_SLIDE_RATIO,
    MIN_PROBABILITY,
    decide,
)
from scanlock.registration.verification.metrics import Metrics
from scanlock.registration.verification.observability import DirectionObservability, Observability
from scanlock.registration.verification.status import Status


def _solution(reason=StopReason.STEP_SMALL):
    at = Quadratic(-1.0, np.zeros(6), np.eye(6))
    return Solution(Pose.identity(), at, reason, ())


def _hold(ratio=0.5):
    axes = np.eye(3)
    shares = (ratio, 0.8, 1.0)
    return Observability(
        tuple(
            DirectionObservability(kind, axes[i], shares[i] if kind == "translation" else 1.0, 0.01)
            for kind in ("translation", "rotation")
            for i in range(3)
        ),
        np.eye(6),
    )


def _inspection(observability=None, runner_up=math.nan, slide_ratio=math.nan, **metrics):
    seen = {"overlap": 0.8, "target_overlap": 0.7, "score": 0.5, "second_best": 0.2, "misfit": 0.1,
            "drift": 0.02,
            **metrics}  # fmt: skip
    return Assessment(Metrics(**seen), observability or _hold(), runner_up, slide_ratio)


@pytest.mark.parametrize("reason", [StopReason.GRADIENT_SMALL, StopReason.STEP_SMALL])
def test_a_converged_pose_is_ok_from_a_probability_on(reason):
    below = math.nextafter(MIN_PROBABILITY, 0.0)
    for probability, expected in (
        (1.0, Status.OK),
        (MIN_PROBABILITY, Status.OK),
        (below, Status.LOW_OVERLAP),
        (0.0, Status.LOW_OVERLAP),
    ):
        status, sentence = decide(_solution(reason), _inspection(), probability)
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
def test_a_solver_that_gave_up_is_never_ok(reason, status):
    found, sentence = decide(_solution(reason), _inspection(), 1.0)
    assert found is status
    assert sentence.startswith(reason.value)


def test_a_direction_that_nothing_holds_is_degenerate_and_named():
    status, sentence = decide(_solution(), _inspection(_hold(ratio=0.001)), 1.0)
    assert status is Status.DEGENERATE
    assert "forward" in sentence
    assert decide(_solution(), _inspection(_hold(ratio=0.1)), 1.0)[0] is Status.OK


@pytest.mark.parametrize("disagreeing", [{"misfit": 0.4}, {"violation": 0.3}, {"misfit": math.nan}])
def test_scans_that_do_not_agree_are_not_called_degenerate(disagreeing):
    status, sentence = decide(_solution(), _inspection(_hold(ratio=0.001), **disagreeing), 0.2)
    assert status is Status.LOW_OVERLAP
    assert "likely wrong" in sentence


def test_without_shared_surfaces_nothing_is_trusted():
    status, sentence = decide(_solution(), Assessment(Metrics(overlap=0.9, score=0.9), None), 1.0)
    assert status is Status.LOW_OVERLAP
    assert "too few surfaces" in sentence


@pytest.mark.parametrize("name", ["overlap", "target_overlap"])
def test_without_parts_that_meet_nothing_is_trusted(name):
    status, sentence = decide(_solution(), _inspection(**{name: 0.04}), 1.0)
    assert status is Status.LOW_OVERLAP
    assert "too few" in sentence


def test_a_pose_that_is_not_at_rest_is_not_converged():
    above = math.nextafter(MAX_REFINEMENT_SHIFT, 1.0)
    for refinement_shift, probability, expected in (
        (MAX_REFINEMENT_SHIFT, 1.0, Status.OK),
        (above, 1.0, Status.NOT_CONVERGED),
        (above, 0.1, Status.LOW_OVERLAP),
    ):
        assert (
            decide(_solution(), _inspection(refinement_shift=refinement_shift), probability)[0]
            is expected
        )
    assert "0.30 m" in decide(_solution(), _inspection(refinement_shift=0.3), 1.0)[1]


def test_a_rival_that_agrees_as_well_is_ambiguous():
    status, sentence = decide(_solution(), _inspection(runner_up_ratio=0.95, runner_up=0.95), 1.0)
    assert status is Status.AMBIGUOUS
    assert "95%" in sentence
    # What the search found may be decided by the caller; what slides may slide a bit.
    for runner_up, slide_ratio, expected in (
        (MAX_RUNNER_UP_RATIO, MAX_SLIDE_RATIO, Status.OK),
        (math.nextafter(MAX_RUNNER_UP_RATIO, 1.0), 0.0, Status.AMBIGUOUS),
        (0.0, math.nextafter(MAX_SLIDE_RATIO, 1.0), Status.AMBIGUOUS),
        (math.nan, math.nan, Status.OK),
    ):
        seen = _inspection(runner_up_ratio=0.95, runner_up=runner_up, slide_ratio=slide_ratio)
        assert decide(_solution(), seen, 1.0)[0] is expected


def _candidate(overlap=0.8, score=0.5, violation=0.02):
    return Candidate(Pose.identity(), "heading search", overlap, 0.7, score, violation)


def test_the_second_best_is_a_share_of_the_best():
    assert runner_up_ratio([_candidate()]) == 0.0
    assert runner_up_ratio([_candidate(), _candidate(score=0.2)]) == pytest.approx(0.4)
    assert np.isnan(runner_up_ratio([]))
    assert np.isnan(runner_up_ratio([_candidate(score=0.0)]))
