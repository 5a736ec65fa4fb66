"""Choice among refined poses with similar scores, by the verification of each."""

import math
from collections.abc import Sequence
from dataclasses import replace

from scanlock.optimisation.solvers.criteria import StopReason
from scanlock.registration.methods.auto.data import AutoPair
from scanlock.registration.methods.auto.ranking import ScoredPose
from scanlock.registration.verification.assessment import assess_pose
from scanlock.registration.verification.candidate import INITIAL
from scanlock.registration.verification.probability import log_odds

_MIN_SCORE_RATIO = 0.3
"""Minimum score of a pose that is judged, as a fraction of the highest. Of whole scans of vehicles
one pose is above it, which needs no judgement. A colonnade scores 0.6 one period away."""

_INITIAL_PREFERENCE = 2.0
"""Log odds by which another pose must exceed that of the initial pose. Those of two look-alikes
differ by about one."""

_MAX_JUDGED = 5
"""Maximum number of poses that are judged."""


def judged_poses(pair: AutoPair, ranked: Sequence[ScoredPose]) -> list[ScoredPose]:
    """Return ranked poses with those of similar scores in the order of their probabilities.

    The score is how much of the scans agrees; the verification also measures how well. Poses of
    the initial pose are judged whatever their score. A single pose is returned unchanged.
    """
    # A distant prior can make all scores negative; the best is judged nevertheless.
    min_score = min(_MIN_SCORE_RATIO * ranked[0].score, ranked[0].score)
    contenders = [
        one
        for one in ranked
        if one.solution.reason is not StopReason.EMPTY_OBJECTIVE
        and (one.score >= min_score or one.candidate.proposed_by == INITIAL)
    ][:_MAX_JUDGED]
    if len(contenders) < 2:
        return list(ranked)
    odds = [_log_odds(pair, one) for one in contenders]
    judged = [
        replace(one, candidate=replace(one.candidate, probability=_probability(value)))
        for one, value in zip(contenders, odds, strict=True)
    ]
    preferred = [
        value + _INITIAL_PREFERENCE * (one.candidate.proposed_by == INITIAL)
        for value, one in zip(odds, judged, strict=True)
    ]
    order = sorted(range(len(judged)), key=lambda row: preferred[row], reverse=True)
    others = [one for one in ranked if one not in contenders]
    return [*(judged[row] for row in order), *others]


def _log_odds(pair: AutoPair, one: ScoredPose) -> float:
    """Return the log odds of a pose by its verification and the prior."""
    pose = one.solution.pose
    assessment = assess_pose(pair.target.features, pair.source.features, pose, (one.candidate,))
    return log_odds(assessment.metrics, assessment.directions) - pair.prior_penalty(pose)


def _probability(value: float) -> float:
    return 1.0 / (1.0 + math.exp(-min(500.0, max(-500.0, value))))
