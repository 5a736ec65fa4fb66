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
from scanlock.optimisation.solvers.iterate import Path, iterate, norm
from scanlock.optimisation.solvers.problem import Curvature, Objective
from scanlock.optimisation.solvers.solution import Solution

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
        return iterate(objective, start, self.criteria, self.rotation_scale, Damping(self))


class Damping:
    """Globalisation of Gauss-Newton steps by damping."""

    def __init__(self, settings: LevenbergMarquardt) -> None:
        self._settings = settings
        self._damping = settings.first_damping

    def propose(self, gradient: Vector, hessian: Matrix) -> Vector:
        """Return the step to the minimum of a convex quadratic plus damping."""
        curvatures, axes = np.linalg.eigh(hessian)
        curvatures = np.maximum(curvatures, 0.0)
        # A minimum proportional to the gradient bounds the step along axes without curvature.
        # Along axes with a gradient of rounding errors only, the step stays small.
        minimum = norm(gradient) / self._settings.max_step
        damped = np.maximum(curvatures + self._damping * float(curvatures.mean()), minimum)
        return axes @ (-(axes.T @ gradient) / damped)

    def advance(self, path: Path, step: Vector, step_norm: float) -> bool:
        """Move by a step that lowers the value, and adapt the damping."""
        before = path.current.quadratic.value
        tried = path.evaluate(step, step_norm)
        if tried.quadratic.value < before:
            path.move_to(tried)
            self._damping /= self._settings.decay
        else:
            self._damping = max(self._damping, _MIN_DAMPING) * self._settings.growth
        return True

    def finish(self, path: Path, reason: StopReason) -> None:
        """Keep the current pose, which is the best one."""
