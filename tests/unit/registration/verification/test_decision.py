import math

import numpy as np
import pytest

from scanlock.geometry.pose import Pose
from scanlock.optimisation.solvers.problem import Quadratic
from scanlock.optimisation.solvers.solution import Solution
from scanlock.optimisation.solvers.stopping import StopReason
from scanlock.registration.verification.assessment import Inspection
from scanlock.registration.verification.candidate import Candidate, second_best
from scanlock.registration.verification.decision import (
    LEAST_PROBABILITY,
    MOST_DRIFT,
    MOST_RIVALRY,
    MOST_SLIDE,
    judge,
)
from scanlock.registration.verification.metrics import Metrics
from scanlock.registration.verification.observability import HeldDirection, Hold
from scanlock.registration.verification.status import Status


def _solution(reason=StopReason.STEP_SMALL):
    at = Quadratic(-1.0, np.zeros(6), np.eye(6))
    return Solution(Pose.identity(), at, reason, ())


def _hold(share=0.5):
    axes = np.eye(3)
    shares = (share, 0.8, 1.0)
    return Hold(
        tuple(
            HeldDirection(kind, axes[i], shares[i] if kind == "translation" else 1.0, 0.01)
            for kind in ("translation", "rotation")
            for i in range(3)
        ),
        np.eye(6),
    )


def _inspection(hold=None, rival=math.nan, slide=math.nan, **metrics):
    seen = {"overlap": 0.8, "target_overlap": 0.7, "score": 0.5, "second_best": 0.2, "misfit": 0.1,
            "drift": 0.02,
            **metrics}  # fmt: skip
    return Inspection(Metrics(**seen), hold or _hold(), rival, slide)


@pytest.mark.parametrize("reason", [StopReason.GRADIENT_SMALL, StopReason.STEP_SMALL])
def test_a_converged_pose_is_ok_from_a_probability_on(reason):
    below = math.nextafter(LEAST_PROBABILITY, 0.0)
    for probability, expected in (
        (1.0, Status.OK),
        (LEAST_PROBABILITY, Status.OK),
        (below, Status.LOW_OVERLAP),
        (0.0, Status.LOW_OVERLAP),
    ):
        status, sentence = judge(_solution(reason), _inspection(), probability)
        assert status is expected
        assert "80%" in sentence
        assert "0.50" in sentence


@pytest.mark.parametrize(
    ("reason", "status"),
    [
        (StopReason.NO_SUPPORT, Status.NO_CORRESPONDENCES),
        (StopReason.ITERATION_LIMIT, Status.NOT_CONVERGED),
    ],
)
def test_a_solver_that_gave_up_is_never_ok(reason, status):
    assert judge(_solution(reason), _inspection(), 1.0) == (status, reason.value)


def test_a_direction_that_nothing_holds_is_degenerate_and_named():
    status, sentence = judge(_solution(), _inspection(_hold(share=0.001)), 1.0)
    assert status is Status.DEGENERATE
    assert "forward" in sentence
    assert judge(_solution(), _inspection(_hold(share=0.1)), 1.0)[0] is Status.OK


@pytest.mark.parametrize("disagreeing", [{"misfit": 0.4}, {"violation": 0.3}, {"misfit": math.nan}])
def test_scans_that_do_not_agree_are_not_called_degenerate(disagreeing):
    status, sentence = judge(_solution(), _inspection(_hold(share=0.001), **disagreeing), 0.2)
    assert status is Status.LOW_OVERLAP
    assert "likely wrong" in sentence


def test_without_shared_surfaces_nothing_is_trusted():
    status, sentence = judge(_solution(), Inspection(Metrics(overlap=0.9, score=0.9), None), 1.0)
    assert status is Status.LOW_OVERLAP
    assert "too few surfaces" in sentence


@pytest.mark.parametrize("name", ["overlap", "target_overlap"])
def test_without_parts_that_meet_nothing_is_trusted(name):
    status, sentence = judge(_solution(), _inspection(**{name: 0.04}), 1.0)
    assert status is Status.LOW_OVERLAP
    assert "too few" in sentence


def test_a_pose_that_is_not_at_rest_is_not_converged():
    above = math.nextafter(MOST_DRIFT, 1.0)
    for drift, probability, expected in (
        (MOST_DRIFT, 1.0, Status.OK),
        (above, 1.0, Status.NOT_CONVERGED),
        (above, 0.1, Status.LOW_OVERLAP),
    ):
        assert judge(_solution(), _inspection(drift=drift), probability)[0] is expected
    assert "0.30 m" in judge(_solution(), _inspection(drift=0.3), 1.0)[1]


def test_a_rival_that_agrees_as_well_is_ambiguous():
    status, sentence = judge(_solution(), _inspection(second_best=0.95, rival=0.95), 1.0)
    assert status is Status.AMBIGUOUS
    assert "95%" in sentence
    # What the search found may be decided by the caller; what slides may slide a bit.
    for rival, slide, expected in (
        (MOST_RIVALRY, MOST_SLIDE, Status.OK),
        (math.nextafter(MOST_RIVALRY, 1.0), 0.0, Status.AMBIGUOUS),
        (0.0, math.nextafter(MOST_SLIDE, 1.0), Status.AMBIGUOUS),
        (math.nan, math.nan, Status.OK),
    ):
        seen = _inspection(second_best=0.95, rival=rival, slide=slide)
        assert judge(_solution(), seen, 1.0)[0] is expected


def _candidate(overlap=0.8, score=0.5, violation=0.02):
    return Candidate(Pose.identity(), "heading search", overlap, 0.7, score, violation)


def test_the_second_best_is_a_share_of_the_best():
    assert second_best([_candidate()]) == 0.0
    assert second_best([_candidate(), _candidate(score=0.2)]) == pytest.approx(0.4)
    assert np.isnan(second_best([]))
    assert np.isnan(second_best([_candidate(score=0.0)]))
