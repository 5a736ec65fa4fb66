"""Decision on a pose: the status of a result, and the sentence that explains it."""

import math
from collections.abc import Sequence

from scanlock.optimisation.solvers.criteria import StopReason
from scanlock.optimisation.solvers.solution import Solution
from scanlock.registration.verification.assessment import Assessment
from scanlock.registration.verification.candidate import MAX_FREE_SPACE_VIOLATION, Candidate
from scanlock.registration.verification.metrics import Metrics
from scanlock.registration.verification.status import Status

MIN_PROBABILITY = 0.9
"""Minimum probability of a correct pose for `Status.OK`; see `probability`."""

_MIN_OVERLAP = 0.05
"""Minimum overlap of either scan. Correct poses of real scans cut to little overlap have 0.09 or
more."""

_MAX_OUTLIER_RATIO = 0.25
"""Maximum outlier ratio of a degenerate pose. Few scans of different places have less."""

MAX_RUNNER_UP_RATIO = 0.75
"""Ambiguity threshold: ranking value of the runner-up divided by that of the estimate. In terraces
of equal houses the correct pose scores down to 0.78 of a false one. 262 whole real scans stay below
0.3; of 450 scans cut to sectors, two exceed 0.7."""

MAX_SHIFTED_SCORE_RATIO = 0.9
"""Ambiguity threshold: best score of the shifted source divided by the score at the pose. Endless
corridors exceed it; whole real scans with long walls or rows of trees reach 0.8."""

_MAX_SCALE_DIFFERENCE = 0.004
"""Largest difference of scale of an accurate pose: 0.12 m at a range of 30 m."""

_SCALE_DEVIATIONS = 6.0
"""Standard deviations from which on a difference of scale is significant. Its deviation leaves out
what is common to all planes; calibrations of two sensors differ by up to three."""

_MIN_SEPARATION = (1.0, math.radians(5.0))
"""Translation [m] or rotation [rad] from which on another verified pose makes a pose ambiguous."""

MAX_REFINEMENT_SHIFT = 0.2
"""Maximum refinement shift [m] of an accurate pose. It is two thirds of the tolerance of a correct
pose, so that poses just outside the tolerance are not accepted."""


def decide_status(
    solution: Solution, assessment: Assessment, probability: float, length_scale: float = 1.0
) -> tuple[Status, str]:
    """Decide the status of a solution, and explain it in a sentence.

    Parameters
    ----------
    solution : Solution
    assessment : Assessment
        Assessment of the pose of the solution.
    probability : float
        Probability that the pose is correct, from the same assessment.
    length_scale : float
        Factor of the lengths of the thresholds; the assessment is in metres.
    """
    if solution.reason is StopReason.EMPTY_OBJECTIVE:
        remedy = "try a better initial pose or a larger correspondence distance"
        return Status.NO_CORRESPONDENCES, f"{solution.reason.value}; {remedy}"
    metrics = assessment.metrics
    facts = f"overlap {metrics.overlap:.0%}, score {metrics.score:.2f}"
    # Before convergence: a solver may not converge along an unconstrained direction.
    if assessment.degenerate and _is_consistent(metrics):
        directions = "; ".join(str(one) for one in assessment.degenerate)
        return Status.DEGENERATE, (
            f"the overlapping geometry does not constrain {directions}; the pose may be off there. "
            "Pass prior=, or fix_degenerate=True with initial="
        )
    if not solution.reason.is_converged:
        return Status.NOT_CONVERGED, solution.reason.value
    is_apart = min(metrics.overlap, metrics.target_overlap) < _MIN_OVERLAP
    if assessment.observability is None or is_apart:
        lack = "too little overlap" if is_apart else "too few common surfaces"
        return Status.LOW_OVERLAP, (
            f"{facts}: {lack} to verify the pose; use scans closer together, or a better initial "
            "pose"
        )
    if probability >= 0.5 and metrics.refinement_shift > length_scale * MAX_REFINEMENT_SHIFT:
        return Status.INACCURATE, (
            f"{facts}, but point-to-plane refinement would still move the pose by "
            f"{metrics.refinement_shift:.2f} m (a degree counts as {0.3 * length_scale:g} m); pass "
            "it as initial= to auto or gicp"
        )
    if probability >= 0.5 and (
        other := _other_pose(solution, assessment, probability, length_scale)
    ):
        return Status.AMBIGUOUS, f"{facts}, but {other}; compare the candidates, or pass prior="
    if assessment.degenerate or probability < MIN_PROBABILITY:
        outcome = "is likely wrong" if probability < 0.5 else "may be wrong"
        return Status.UNVERIFIED, (
            f"{facts}: the pose {outcome}, its probability is {probability:.2f}; use a better "
            "initial pose, or scans closer together"
        )
    if has_other_scale(metrics):
        return Status.UNVERIFIED, (
            f"{facts}, but the scales of the scans differ by about "
            f"{abs(metrics.scale_difference):.1%}; check the units and the calibration"
        )
    return Status.OK, f"{facts}, probability {probability:.3f}"


def has_other_scale(metrics: Metrics) -> bool:
    """Return whether the scales of the scans differ, significantly and by more than 0.4 %."""
    significant = _SCALE_DEVIATIONS * metrics.scale_deviation
    return abs(metrics.scale_difference) > max(_MAX_SCALE_DIFFERENCE, significant)


def _other_pose(
    solution: Solution, assessment: Assessment, probability: float, length_scale: float
) -> str:
    """Describe another pose that may be right as well; empty if there is none.

    It is as probable as the pose, or would be accepted, or scores nearly as well.
    """
    candidates: Sequence[Candidate] = solution.candidates
    metres, radians = _MIN_SEPARATION
    others = [
        one
        for one in candidates[1:]
        if one.probability >= min(MIN_PROBABILITY, probability)
        and not one.target_from_source.is_close(solution.pose, translation=metres, rotation=radians)
    ]
    if others:
        best = max(others, key=lambda one: one.probability)
        distance, angle = best.target_from_source.distance(solution.pose)
        return (
            f"another pose has the probability {best.probability:.2f}, "
            f"{length_scale * distance:.2f} m and {math.degrees(angle):.1f} degrees away"
        )
    if (
        assessment.runner_up_ratio > MAX_RUNNER_UP_RATIO
        or assessment.shifted_score_ratio > MAX_SHIFTED_SCORE_RATIO
    ):
        return f"another pose has {assessment.metrics.runner_up_ratio:.0%} of its agreement"
    return ""


def _is_consistent(metrics: Metrics) -> bool:
    """Return whether the scans agree wherever they overlap.

    A pose off along a degenerate direction does: such a shift causes neither outliers nor
    free-space violations.
    """
    return (
        metrics.outlier_ratio < _MAX_OUTLIER_RATIO
        and not metrics.free_space_violation >= MAX_FREE_SPACE_VIOLATION
    )
