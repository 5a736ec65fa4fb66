"""Gauss and Newton's method, damped by Levenberg and Marquardt, on poses.

It wants the convex part of the Hessian, which is never indefinite, so no eigenvalue needs repair:
the damping alone keeps a step short where the quadratic does not predict well.
"""

from dataclasses import dataclass, field

import numpy as np

from scanlock.arrays import Matrix, Vector
from scanlock.errors import require_at_least, require_positive
from scanlock.geometry.pose import Pose
from scanlock.optimisation.solvers.criteria import ConvergenceCriteria, StopReason
from scanlock.optimisation.solvers.problem import Curvature, Objective, Quadratic
from scanlock.optimisation.solvers.solution import Iteration, Solution

_LEAST_DAMPING = 1e-4
"""Where damping begins once a step was refused; less would hardly change the step."""


@dataclass(frozen=True, kw_only=True, slots=True)
class LevenbergMarquardt:
    """Settings of the damped Gauss-Newton solver."""

    criteria: ConvergenceCriteria = field(default_factory=ConvergenceCriteria)
    """Tolerances and the limit of evaluations."""

    rotation_scale: float = 20.0
    """Distance at which a rotation counts as a translation [m]; about the range of a scan."""

    first_damping: float = 1e-3
    """Damping of the first step as a share of the mean curvature; 0 is plain Gauss-Newton until
    a step is refused."""

    growth: float = 10.0
    """Factor of the damping after a step that was refused."""

    decay: float = 10.0
    """Divisor of the damping after a step that was not."""

    max_step: float = 10.0
    """Longest step along any one axis of the quadratic [m, rotations at the lever arm]."""

    def __post_init__(self) -> None:
        require_positive("lever", self.rotation_scale, unit="m")
        require_at_least("first_damping", self.first_damping, 0.0)
        require_at_least("growth", self.growth, 1.5)
        require_at_least("decay", self.decay, 1.0)
        require_positive("longest_step", self.max_step, unit="m")

    @property
    def curvature(self) -> Curvature:
        """The Hessian that the solver wants of an objective."""
        return "convex"

    def minimise(self, objective: Objective, start: Pose) -> Solution:
        """Return the best pose found from `start`, with every evaluation on the way."""
        scale = np.array(
            [1.0, 1.0, 1.0, self.rotation_scale, self.rotation_scale, self.rotation_scale]
        )
        pose, damping = start, self.first_damping
        quadratic = objective.linearise(pose)
        history = [Iteration(quadratic.value, _norm(quadratic, scale), 0.0, True, pose)]
        if quadratic.value == 0.0 and not quadratic.gradient.any() and not quadratic.hessian.any():
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
                damping = max(damping, _LEAST_DAMPING) * self.growth
        return Solution(pose, quadratic, StopReason.ITERATION_LIMIT, tuple(history))


def _norm(quadratic: Quadratic, scale: Vector) -> float:
    return float(np.linalg.norm(quadratic.gradient / scale))


def _damped_step(gradient: Vector, hessian: Matrix, damping: float, longest: float) -> Vector:
    """Return the step to the minimum of a convex quadratic plus damping."""
    curvatures, axes = np.linalg.eigh(hessian)
    curvatures = np.maximum(curvatures, 0.0)
    # A floor that vanishes with the slope bounds the step where nothing else does, and hardly
    # moves along an axis whose slope is all rounding.
    floor = float(np.linalg.norm(gradient)) / longest
    damped = np.maximum(curvatures + damping * float(curvatures.mean()), floor)
    return axes @ (-(axes.T @ gradient) / damped)
