"""Where a solver ended and how it came there; every solver leaves the same records."""

import math
from dataclasses import dataclass
from typing import Any

from scanlock.geometry.pose import Pose
from scanlock.optimisation.solvers.criteria import StopReason
from scanlock.optimisation.solvers.problem import Objective, Quadratic


@dataclass(frozen=True, slots=True, eq=False)
class Iteration:
    """One evaluation of the objective on the way.

    Attributes
    ----------
    value : float
        Objective at the pose tried.
    gradient_norm, step_norm : float
        In scaled units (metres at the lever arm).
    accepted : bool
        Whether the solver moved there.
    pose : Pose
        The pose tried, target from source.
    mean_distance : float [m]
        Mean distance of the closest points, for methods that pair points; NaN for others.
    pairs : int or None
        How many pairs counted, for methods that pair points.
    """

    value: float
    gradient_norm: float
    step_norm: float
    accepted: bool
    pose: Pose
    mean_distance: float = math.nan
    pairs: int | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """Where a solver ended and how it came there.

    Attributes
    ----------
    pose : Pose
        The best pose seen, or a step from it that was too small to be worth an evaluation.
    quadratic : Quadratic
        The objective there; after such a step, as foretold before it.
    reason : StopReason
    history : tuple of Iteration
    notes : tuple of str
        What was found on the way that a user may want to know.
    objective : Objective or None
        What was minimised at the last stage, under its restraint; None where a solver alone ran,
        whose caller knows it.
    candidates : tuple
        Finished poses of a method that searches, best first: `verification.candidate.Candidate`.
    runner_up_ratio : float
        Score of the second candidate over that of the first; NaN without a search.
    """

    pose: Pose
    quadratic: Quadratic
    reason: StopReason
    history: tuple[Iteration, ...]
    notes: tuple[str, ...] = ()
    objective: Objective | None = None
    candidates: tuple[Any, ...] = ()
    runner_up_ratio: float = math.nan
