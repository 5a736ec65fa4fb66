"""Whether a pose can be trusted: the status of a result, and the sentence that explains it."""

from scanlock.optimisation.solvers.criteria import StopReason
from scanlock.optimisation.solvers.solution import Solution
from scanlock.registration.verification.assessment import Assessment
from scanlock.registration.verification.candidate import HALVING_VIOLATION
from scanlock.registration.verification.metrics import Metrics
from scanlock.registration.verification.status import Status

MIN_PROBABILITY = 0.9
"""Of a pose that is trusted; see `scanlock.registration.verification.probability`."""

_LEAST_OVERLAP = 0.05
"""Of either scan: right poses of real scans cut down to what hardly overlaps had 0.09 or more."""

_MOST_MISFIT = 0.25
"""Of scans that agree but along their weak directions: of other places few fit as well."""

MAX_RUNNER_UP_RATIO = 0.75
"""Another pose that agrees this share as well makes the one chosen a toss-up. Of the same places
seen from farther away less is shared, so the right one may agree less than a rival: in terraces of
equal houses down to 0.78. Of 262 whole real scans at their right poses none has a rival above 0.3,
of 450 cut to sectors two have one above 0.7."""

MAX_SLIDE_RATIO = 0.9
"""As well as the pose itself agrees the source slid along it in endless corridors; of whole
real scans at their right poses, where walls and rows of trees go on, up to 0.8."""

MAX_REFINEMENT_SHIFT = 0.2
"""A pose that would still move so far [m] onto the surfaces has not come to rest: two thirds of
what may be missing from a right one, so that those just beyond are not called right."""


def decide(
    solution: Solution, inspection: Assessment, probability_right: float
) -> tuple[Status, str]:
    """Return the status of a solution and the sentence that explains it."""
    if solution.reason is StopReason.EMPTY_OBJECTIVE:
        remedy = "try a better initial pose or a larger correspondence distance"
        return Status.NO_CORRESPONDENCES, f"{solution.reason.value}; {remedy}"
    metrics = inspection.metrics
    found = (
        f"{metrics.overlap:.0%} of the source meets the target with a score of {metrics.score:.2f}"
    )
    # Before convergence: a solver may wander along what nothing holds, and that is the reason.
    if inspection.degenerate and _agree(metrics):
        named = "; ".join(str(one) for one in inspection.degenerate)
        return Status.DEGENERATE, (
            f"nothing that both scans show holds the pose {named}: it may be wrong along that; "
            "give a prior, or hold weak directions at it"
        )
    if not solution.reason.is_converged:
        return Status.NOT_CONVERGED, solution.reason.value
    if (
        inspection.observability is None
        or min(metrics.overlap, metrics.target_overlap) < _LEAST_OVERLAP
    ):
        return Status.LOW_OVERLAP, (
            f"{found}, but they share too few surfaces to tell whether the pose is right; take "
            "scans closer together, or start nearer"
        )
    if probability_right >= 0.5 and metrics.refinement_shift > MAX_REFINEMENT_SHIFT:
        return Status.NOT_CONVERGED, (
            f"{found}, but on the surfaces that they share the pose would still move by "
            f"{metrics.refinement_shift:.2f} m (a degree counts as 0.3 m): "
            "take it as the initial pose of a "
            "finer method, such as auto or gicp"
        )
    if inspection.degenerate or probability_right < MIN_PROBABILITY:
        doubt = "is likely wrong" if probability_right < 0.5 else "may be wrong"
        return Status.LOW_OVERLAP, (
            f"{found}: the pose {doubt}, right with probability {probability_right:.2f} only; "
            "start "
            "nearer, or take scans closer together"
        )
    if inspection.runner_up > MAX_RUNNER_UP_RATIO or inspection.slide_ratio > MAX_SLIDE_RATIO:
        return Status.AMBIGUOUS, (
            f"{found}, and another pose agrees {metrics.runner_up_ratio:.0%} as well; see the "
            "candidates, or give a prior that decides between them"
        )
    return (
        Status.OK,
        f"{solution.reason.value}; {found}; right with probability {probability_right:.3f}",
    )


def _agree(metrics: Metrics) -> bool:
    """Tell whether the scans agree, wherever along its weak directions the pose may be."""
    # Shifted along what is the same everywhere, nothing comes to stand in the open.
    return metrics.outlier_ratio < _MOST_MISFIT and not metrics.violation >= HALVING_VIOLATION
