"""Levenberg-Marquardt: the damped Gauss-Newton method on poses.

The convex part of the Hessian is never indefinite, so its eigenvalues are used as they are. The
damping shortens steps where the quadratic predicts badly.
"""

from dataclasses import dataclass, field

import numpy as np

from scanlock.arrays import Matrix, Vector
from scanlock.errors import require_at_least, require_positive
from scanlock.geometry.pose import Pose
from scanlock.optimisation.solvers.criteria import ConvergenceCriteria, StopReason
from scanlock.optimisation.solvers.problem import Curvature, Objective, Quadratic
from scanlock.optimisation.solvers.solution import Iteration, Solution

_MIN_DAMPING = 1e-4
"""Minimum damping after a rejected step; less would hardly change the step."""


@dataclass(frozen=True, kw_only=True, slots=True)
class LevenbergMarquardt:
    """Settings of the damped Gauss-Newton solver."""

    criteria: ConvergenceCriteria = field(default_factory=ConvergenceCriteria)
    """Convergence criteria."""

    rotation_scale: float = 20.0
    """Distance at which a rotation counts as a translation [m]; about the range of a scan."""

    first_damping: float = 1e-3
    """Damping of the first step over the mean curvature; 0 is plain Gauss-Newton until a step is
    rejected."""

    growth: float = 10.0
    """Factor of the damping after a rejected step."""

    decay: float = 10.0
    """Divisor of the damping after an accepted step."""

    max_step: float = 10.0
    """Maximum step along any one axis of the quadratic [m]; rotations count at the rotation
    scale."""

    def __post_init__(self) -> None:
        require_positive("rotation_scale", self.rotation_scale, unit="m")
        require_at_least("first_damping", self.first_damping, 0.0)
        require_at_least("growth", self.growth, 1.5)
        require_at_least("decay", self.decay, 1.0)
        require_positive("max_step", self.max_step, unit="m")

    @property
    def curvature(self) -> Curvature:
        """Hessian that the solver needs of an objective."""
        return "convex"

    def minimise(self, objective: Objective, start: Pose) -> Solution:
        """Return the best pose found from `start`, with the history of all evaluations."""
        scale = np.array(
            [1.0, 1.0, 1.0, self.rotation_scale, self.rotation_scale, self.rotation_scale]
        )
        pose, damping = start, self.first_damping
        quadratic = objective.linearise(pose)
        history = [Iteration(quadratic.value, _norm(quadratic, scale), 0.0, True, pose)]
        if quadratic.is_empty:
            return Solution(pose, quadratic, StopReason.EMPTY_OBJECTIVE, tuple(history))

        while len(history) < self.criteria.max_iterations:
            gradient = quadratic.gradient / scale
            if np.linalg.norm(gradient) < self.criteria.gradient_tolerance:
                return Solution(pose, quadratic, StopReason.GRADIENT_SMALL, tuple(history))
            hessian = quadratic.hessian / np.outer(scale, scale)
            step = _damped_step(gradient, hessian, damping, self.max_step)
            step_norm = float(np.linalg.norm(step))
            if step_norm < self.criteria.step_tolerance:
                return Solution(pose, quadratic, StopReason.STEP_SMALL, tuple(history))

            tried_pose = pose.retract(step / scale)
            tried = objective.linearise(tried_pose)
            accepted = tried.value < quadratic.value
            history.append(
                Iteration(tried.value, _norm(tried, scale), step_norm, accepted, tried_pose)
            )
            if accepted:
                pose, quadratic, damping = tried_pose, tried, damping / self.decay
            else:
                damping = max(damping, _MIN_DAMPING) * self.growth
        return Solution(pose, quadratic, StopReason.ITERATION_LIMIT, tuple(history))


def _norm(quadratic: Quadratic, scale: Vector) -> float:
    return float(np.linalg.norm(quadratic.gradient / scale))


def _damped_step(gradient: Vector, hessian: Matrix, damping: float, max_step: float) -> Vector:
    """Return the step to the minimum of a convex quadratic plus damping."""
    curvatures, axes = np.linalg.eigh(hessian)
    curvatures = np.maximum(curvatures, 0.0)
    # A minimum proportional to the gradient bounds the step along axes without curvature. Along
    # those whose gradient is rounding the step stays small.
    minimum = float(np.linalg.norm(gradient)) / max_step
    damped = np.maximum(curvatures + damping * float(curvatures.mean()), minimum)
    return axes @ (-(axes.T @ gradient) / damped)
