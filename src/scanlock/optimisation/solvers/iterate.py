"""The iteration loop of all solvers.

A solver is a rule for directions plus a globalisation, which makes it converge from far starts: a
trust region, damping or a line search. Convergence criteria, scaling and history are the same for
all solvers.
"""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from scanlock.arrays import Matrix, Vector
from scanlock.geometry.pose import Pose
from scanlock.optimisation.solvers.criteria import ConvergenceCriteria, StopReason
from scanlock.optimisation.solvers.problem import Objective, Quadratic, scale_vector
from scanlock.optimisation.solvers.solution import Iteration, Solution


@dataclass(slots=True, eq=False)
class Evaluation:
    """The objective at one pose; gradient and norms in scaled units."""

    pose: Pose
    quadratic: Quadratic
    gradient: Vector
    gradient_norm: float
    step_norm: float
    is_accepted: bool = False


class Path:
    """Evaluations of a solver so far and its current pose.

    Steps are in scaled units [m]: a rotation counts at the rotation scale.
    """

    def __init__(
        self,
        objective: Objective,
        start: Pose,
        criteria: ConvergenceCriteria,
        rotation_scale: float,
    ) -> None:
        self.objective = objective
        self.criteria = criteria
        self.scale = scale_vector(rotation_scale)
        self._squares = np.outer(self.scale, self.scale)
        self.evaluations: list[Evaluation] = []
        self.current = self._evaluated(start, 0.0)
        self.current.is_accepted = True
        self._last: tuple[Pose, Quadratic] | None = None

    @property
    def remaining(self) -> int:
        """Number of evaluations left."""
        return self.criteria.max_iterations - len(self.evaluations)

    @property
    def hessian(self) -> Matrix:
        """Scaled Hessian at the current pose."""
        return self.current.quadratic.hessian / self._squares

    def evaluate(self, step: Vector, step_norm: float) -> Evaluation:
        """Evaluate the objective at a step from the current pose."""
        return self._evaluated(self.current.pose.retract(step / self.scale), step_norm)

    def move_to(self, evaluation: Evaluation) -> None:
        """Accept an evaluation: its pose is the current one."""
        evaluation.is_accepted = True
        self.current = evaluation

    def finish_with(self, step: Vector) -> None:
        """Take a last step from the current pose, predicted instead of evaluated."""
        step = step / self.scale
        self._last = self.current.pose.retract(step), self.current.quadratic.after(step)

    def solution(self, reason: StopReason) -> Solution:
        """Return the result at the current pose or after the last step."""
        pose, quadratic = self._last or (self.current.pose, self.current.quadratic)
        history = tuple(
            Iteration(
                one.quadratic.value, one.gradient_norm, one.step_norm, one.is_accepted, one.pose
            )
            for one in self.evaluations
        )
        return Solution(pose, quadratic, reason, history, objective=self.objective)

    def _evaluated(self, pose: Pose, step_norm: float) -> Evaluation:
        quadratic = self.objective.linearise(pose)
        gradient = quadratic.gradient / self.scale
        evaluation = Evaluation(pose, quadratic, gradient, norm(gradient), step_norm)
        self.evaluations.append(evaluation)
        return evaluation


class Globalisation(Protocol):
    """Choice of the steps of one run; it may adapt to the steps taken so far."""

    def propose(self, gradient: Vector, hessian: Matrix) -> Vector:
        """Return the next step (6,) for a scaled gradient and Hessian."""
        ...

    def advance(self, path: Path, step: Vector, step_norm: float) -> bool:
        """Evaluate the objective along a step and move the path; return False to stop there."""
        ...

    def finish(self, path: Path, reason: StopReason) -> None:
        """Set the final pose of a path that has stopped."""
        ...


def iterate(
    objective: Objective,
    start: Pose,
    criteria: ConvergenceCriteria,
    rotation_scale: float,
    globalisation: Globalisation,
) -> Solution:
    """Minimise an objective from a start.

    Parameters
    ----------
    objective : Objective
    start : Pose
    criteria : ConvergenceCriteria
    rotation_scale : float [m]
        Distance at which a rotation counts as a translation.
    globalisation : Globalisation
        Choice of the steps, new for each run.
    """
    path = Path(objective, start, criteria, rotation_scale)
    reason = _run(path, globalisation)
    globalisation.finish(path, reason)
    return path.solution(reason)


def _run(path: Path, globalisation: Globalisation) -> StopReason:
    criteria = path.criteria
    if path.current.quadratic.is_empty:
        return StopReason.EMPTY_OBJECTIVE
    while path.remaining > 0:
        here = path.current
        if here.gradient_norm < criteria.gradient_tolerance:
            return StopReason.GRADIENT_SMALL
        step = globalisation.propose(here.gradient, path.hessian)
        step_norm = norm(step)
        if step_norm < criteria.step_tolerance:
            return StopReason.STEP_SMALL
        if not globalisation.advance(path, step, step_norm):
            return StopReason.STEP_SMALL
    return StopReason.ITERATION_LIMIT


def norm(vector: Vector) -> float:
    """Return the Euclidean norm; for six numbers three times as fast as `numpy.linalg.norm`."""
    return math.sqrt(float(vector @ vector))
