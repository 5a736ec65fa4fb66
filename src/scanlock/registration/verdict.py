"""Whether a pose can be trusted: overlap, score, rivals, and the status that follows."""

import math
from collections.abc import Sequence

import numpy as np

from scanlock.arrays import Vector
from scanlock.models.gaussians import Gaussians
from scanlock.registration.candidate import Candidate, second_best
from scanlock.registration.result import Status
from scanlock.solvers.solution import Solution
from scanlock.solvers.stopping import StopReason

_LEAST_HOLD = 0.15
"""Least hold along the weakest direction of a pose that is trusted, see `weakest_direction`.

Endless corridors, bare walls and lines have up to 0.10; the least of forty real scans, of a wall
in an office, has 0.13. An indoor corridor has 0.23 and passes, though its pose slides; streets,
forests and yards have 0.3 to 0.8.
"""

_LEAST_AGREEMENT = 0.38
"""Least product of overlap and score of a pose that is trusted.

Over 198 registrations of real pairs from easy and from hopeless starts, right poses had at
least 0.41 and wrong ones at most 0.31; each factor alone overlaps. Two scans of one place far
apart fall below it too: the status then errs towards distrust. An indoor corridor was not among
them; it repeats itself, and passes at the wrong place.
"""

_LEAST_CHOSEN_AGREEMENT = 0.08
"""Least agreement of a pose chosen from candidates that is trusted, see `Candidate.agreement`.

The wrong poses of 229 pairs of scans that do not overlap had up to 0.06; of 238 right
ones, up to 30 m apart, 3 % had less than this.
"""

_MOST_RIVALRY = 0.45
"""A rival that agrees this share as well as the pose chosen makes it a toss-up. The right poses
above had rivals of up to 0.33."""


def weakest_direction(gaussians: Gaussians) -> tuple[float, Vector]:
    """Return how firmly the thin sides of a scan hold it where they hold it least, and where.

    A Gaussian holds a translation along its thin axes, not along its longest: that end is where
    a cluster was cut, or where the view ended, and slides along a corridor with the sensor.
    Each axis holds ``(1 - variance / largest variance)^2``, weighted by count.

    Returns
    -------
    hold : float
        Hold along the weakest direction over that along the strongest, in [0, 1].
    direction : (3,)
        Unit vector of the weakest direction, in the frame of the Gaussians.
    """
    # A matrix has the same axes as its square, so none of them need be found one by one.
    thin = np.eye(3) - gaussians.covariances / gaussians.widths[:, None, None]
    rows = thin.reshape(-1, 3)
    held = rows.T @ (np.repeat(gaussians.weights() ** 2, 3)[:, None] * rows)
    holds, directions = np.linalg.eigh(held)
    if holds[2] <= 0.0:
        # Only round Gaussians: each is an object of its own and holds all directions alike.
        return 1.0, directions[:, 0]
    return max(0.0, float(holds[0] / holds[2])), directions[:, 0]


def judge(
    solution: Solution,
    overlap: float,
    score: float,
    hold: float,
    direction: Vector,
    candidates: Sequence[Candidate] = (),
) -> tuple[Status, str]:
    """Return the status of a solution and the sentence that explains it.

    Where a method had candidates to choose from, best first, they are judged in place of overlap
    and score.
    """
    if solution.reason is StopReason.NO_SUPPORT:
        return Status.NO_SUPPORT, solution.reason.value
    if not solution.reason.is_converged:
        return Status.NOT_CONVERGED, solution.reason.value
    agreement = f"{overlap:.0%} of the source meets the target with a score of {score:.2f}"
    is_chosen = bool(candidates) and not math.isnan(candidates[0].score)
    is_low = (
        candidates[0].agreement < _LEAST_CHOSEN_AGREEMENT
        if is_chosen
        else overlap * score < _LEAST_AGREEMENT
    )
    if is_low:
        return Status.LOW_OVERLAP, (
            f"only {agreement}; the pose is likely wrong, or the scans overlap too little to tell"
        )
    if is_chosen and not candidates[0].is_plausible:
        return Status.LOW_OVERLAP, (
            f"{agreement}, but {candidates[0].violation:.0%} of what each scan shows stands where "
            "the other one looked through; the pose is likely wrong"
        )
    if hold < _LEAST_HOLD:
        x, y, z = direction
        return Status.DEGENERATE, (
            f"the scans look alike when shifted along ({x:.2f}, {y:.2f}, {z:.2f}) in the target's "
            f"frame (hold {hold:.2f} of 1): the pose may be wrong along it"
        )
    if is_chosen and second_best(candidates) > _MOST_RIVALRY:
        return Status.AMBIGUOUS, (
            f"{agreement}, and another pose agrees {second_best(candidates):.0%} as well; see the "
            "candidates, or give an initial pose or a prior that decides between them"
        )
    return Status.OK, f"{solution.reason.value}; {agreement}"
