"""Scores of the refined poses of the default method, and their order."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from scanlock.optimisation.solvers.criteria import StopReason
from scanlock.optimisation.solvers.solution import Solution
from scanlock.registration.methods.auto.data import AutoPair
from scanlock.registration.methods.auto.multi_start import RefinedHypothesis
from scanlock.registration.search.hypothesis import distinct_rows
from scanlock.registration.verification.agreement import candidate_at
from scanlock.registration.verification.candidate import INITIAL, Candidate


@dataclass(frozen=True, slots=True, eq=False)
class ScoredPose:
    """A refined pose and its score.

    Attributes
    ----------
    candidate : Candidate
    solution : Solution
    score : float
        Agreement, times the preference for the initial pose, minus the penalty of the prior.
    """

    candidate: Candidate
    solution: Solution
    score: float

    @property
    def rank(self) -> tuple[bool, float]:
        """Sort key: a pose without correspondences comes last."""
        return self.solution.reason is not StopReason.EMPTY_OBJECTIVE, self.score


def score_pose(
    pair: AutoPair, refined: RefinedHypothesis, initial_pose_preference: float
) -> ScoredPose:
    """Score a refined pose: agreement, initial-pose preference, prior."""
    target, source = pair.target.features, pair.source.features
    candidate = candidate_at(target, source, refined.solution.pose, refined.proposed_by)
    score = candidate.agreement
    if candidate.proposed_by == INITIAL:
        score *= initial_pose_preference
    # As in the objectives, the prior is one observation among those of the Gaussians.
    score -= pair.prior_penalty(refined.solution.pose) / max(
        1, len(pair.source.multi_start_gaussians[-1])
    )
    return ScoredPose(candidate, refined.solution, score)


def ranked_poses(scored: Sequence[ScoredPose], separation: tuple[float, float]) -> list[ScoredPose]:
    """Return the distinct poses, highest score first.

    Poses within both separations [m, rad] of a better one are left out.
    """
    ordered = sorted(scored, key=lambda one: one.rank, reverse=True)
    poses = [one.candidate.target_from_source for one in ordered]
    return [ordered[row] for row in distinct_rows(poses, *separation)]


def runner_up_ratio(ranked: Sequence[ScoredPose]) -> float:
    """Return the best score of the other poses over that of the first; 0 without others.

    Poses that are ruled out do not count.
    """
    if ranked[0].score <= 0.0:
        return math.nan if len(ranked) > 1 else 0.0
    others = [one.score for one in ranked[1:] if not one.candidate.is_ruled_out]
    return max(0.0, max(others, default=0.0) / ranked[0].score)
