"""Result of a solver: final pose, reason to stop and history; the same for every solver."""

import math
from dataclasses import dataclass
from typing import Any

from scanlock.arrays import short_repr
from scanlock.geometry.pose import Pose
from scanlock.optimisation.solvers.criteria import StopReason
from scanlock.optimisation.solvers.notes import Note
from scanlock.optimisation.solvers.problem import Objective, Quadratic


@dataclass(frozen=True, slots=True, eq=False)
class Iteration:
    """One evaluation of the objective.

    Attributes
    ----------
    value : float
        Value of the objective at the pose tried.
    gradient_norm, step_norm : float
        Norms in scaled units; rotations count at the solver's rotation scale.
    accepted : bool
        Whether the solver moved to the pose.
    pose : Pose
        Pose tried, target from source.
    mean_distance : float [m]
        Mean distance of the closest points, of methods with correspondences; NaN for others.
    pairs : int or None
        Number of correspondences, of methods with correspondences; None for others.
    """

    value: float
    gradient_norm: float
    step_norm: float
    accepted: bool
    pose: Pose
    mean_distance: float = math.nan
    pairs: int | None = None

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """Result of a solver.

    Attributes
    ----------
    pose : Pose
        Best pose evaluated, or the pose after a last step too small to be evaluated.
    quadratic : Quadratic
        Quadratic of the objective at the pose; after such a last step the predicted one.
    reason : StopReason
    history : tuple of Iteration
        All evaluations, in order.
    notes : tuple of str or LengthNote
        Notes for the user.
    objective : Objective or None
        Objective that was minimised, with its constraints; of several stages that of the last
        one. None where no objective was built.
    candidates : tuple
        Finished poses of a method that searches, best first.
    runner_up_ratio : float
        Score of the second candidate over that of the first; NaN without a search.
    covariance_factor : float or None
        Ratio of the actual standard deviations of the pose to the estimated ones, of a stage that
        was calibrated by itself; None for that of the method.
    """

    pose: Pose
    quadratic: Quadratic
    reason: StopReason
    history: tuple[Iteration, ...]
    notes: tuple[Note, ...] = ()
    objective: Objective | None = None
    candidates: tuple[Any, ...] = ()
    runner_up_ratio: float = math.nan
    covariance_factor: float | None = None

    __repr__ = short_repr
