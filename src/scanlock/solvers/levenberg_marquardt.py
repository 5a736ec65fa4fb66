"""Gauss and Newton's method, damped by Levenberg and Marquardt, on poses.

It wants the convex part of the Hessian, which is never indefinite, so no eigenvalue needs repair:
the damping alone keeps a step short where the quadratic does not predict well.
"""

from dataclasses import dataclass, field

import numpy as np

from scanlock.errors import require_at_least, require_positive
from scanlock.geometry.pose import Pose
from scanlock.objectives.quadratic import Curvature, Objective, Quadratic
from scanlock.solvers.solution import Iteration, Solution
from scanlock.solvers.stopping import Stopping, StopReason

_LEAST_CURVATURE = 1e-9
"""Share of the largest curvature below which a direction is held by rounding alone."""

_LEAST_DAMPING = 1e-9
"""Where damping begins once a step had to be refused."""


@dataclass(frozen=True, kw_only=True, slots=True)
class LevenbergMarquardt:
    """Settings of the damped Gauss-Newton solver."""

    stopping: Stopping = field(default_factory=Stopping)
    """Tolerances and the iteration limit."""

    lever: float = 20.0
    """Distance at which a rotation counts as a translation [m]; about the range of a scan."""

    first_damping: float = 1e-3
    """Damping of the first step as a share of the mean curvature; 0 is plain Gauss-Newton until
    a step fails."""

    growth: float = 10.0
    """Factor of the damping after a step that was refused; its inverse after one that was not."""

    def __post_init__(self) -> None:
        require_positive("lever", self.lever, unit="m")
        require_at_least("first_damping", self.first_damping, 0.0)
        require_at_least("growth", self.growth, 1.5)

    @property
    def curvature(self) -> Curvature:
        """The Hessian that the solver wants of an objective."""
        return "convex"

    def minimise(self, objective: Objective, start: Pose) -> Solution:
        """Return the best pose found from `start`, with every evaluation on the way."""
        scale = np.array([1.0, 1.0, 1.0, self.lever, self.lever, self.lever])
        pose, damping = start, self.first_damping
        quadratic = objective.linearise(pose)
        norm = float(np.linalg.norm(quadratic.gradient / scale))
        history = [Iteration(quadratic.value, norm, 0.0, True, pose)]
        if _is_void(quadratic):
            return Solution(pose, quadratic, StopReason.NO_SUPPORT, tuple(history))

        while len(history) < self.stopping.iterations:
            gradient = quadratic.gradient / scale
            if np.linalg.norm(gradient) < self.stopping.gradient:
                return Solution(pose, quadratic, StopReason.GRADIENT_SMALL, tuple(history))
            curvatures, axes = np.linalg.eigh(quadratic.hessian / np.outer(scale, scale))
            floor = _LEAST_CURVATURE * max(float(curvatures[-1]), np.finfo(float).tiny)
            damped = np.maximum(curvatures, floor) + damping * float(curvatures.mean())
            # A direction that nothing holds, or that is locked, does not move.
            held = np.abs(axes.T @ gradient) > 0.0
            step = axes @ np.where(held, -(axes.T @ gradient) / damped, 0.0)
            step_norm = float(np.linalg.norm(step))
            if step_norm < self.stopping.step:
                return Solution(pose, quadratic, StopReason.STEP_SMALL, tuple(history))

            tried_pose = pose.retract(step / scale)
            tried = objective.linearise(tried_pose)
            accepted = tried.value < quadratic.value
            norm = float(np.linalg.norm(tried.gradient / scale))
            history.append(Iteration(tried.value, norm, step_norm, accepted, tried_pose))
            if accepted:
                pose, quadratic = tried_pose, tried
                damping = damping / self.growth
            else:
                damping = max(damping, _LEAST_DAMPING) * self.growth
        return Solution(pose, quadratic, StopReason.ITERATION_LIMIT, tuple(history))


def _is_void(quadratic: Quadratic) -> bool:
    """Tell whether nothing meets: no value, no slope, no curvature."""
    return quadratic.value == 0.0 and not quadratic.gradient.any() and not quadratic.hessian.any()
