"""Newton's method on poses, with a positive definite Hessian and a trust region.

Algorithm 1 of Das et al. 2013 steps by ``p + H^-1 g``. The minus sign is missing, and where the
Hessian is indefinite (most of the domain, away from the optimum) even ``-H^-1 g`` need not be a
descent direction. Here the eigenvalues of the Hessian are replaced by their absolute values, so
every step is one of descent. The trust radius follows the quality of the last prediction.
"""

import math
from dataclasses import dataclass, field

import numpy as np

from scanlock.arrays import Matrix, Vector
from scanlock.errors import require_at_least, require_positive
from scanlock.geometry.pose import Pose
from scanlock.optimisation.solvers.criteria import ConvergenceCriteria, StopReason
from scanlock.optimisation.solvers.problem import Curvature, Objective, Quadratic
from scanlock.optimisation.solvers.solution import Iteration, Solution

_MIN_CURVATURE = 1e-3
"""Minimum eigenvalue over the largest one, which bounds the step along flat directions."""

_ACCEPTED_GAIN = 1e-4
"""Minimum decrease of an accepted step over the predicted one (Armijo's usual constant)."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Newton:
    """Settings of the trust-region Newton solver."""

    criteria: ConvergenceCriteria = field(
        default_factory=lambda: ConvergenceCriteria(step_tolerance=3e-4)
    )
    """Convergence criteria. The last step is taken without an evaluation: after a step below
    0.3 mm the error is about its square, a thousandth of that."""

    rotation_scale: float = 20.0
    """Distance at which a rotation counts as a translation [m]; about the range of a scan."""

    first_radius: float = 5.0
    """First trust radius [m]; rotations count at the rotation scale."""

    max_radius: float = 10.0
    """Maximum trust radius [m]; rotations count at the rotation scale."""

    def __post_init__(self) -> None:
        require_positive("rotation_scale", self.rotation_scale, unit="m")
        require_positive("first_radius", self.first_radius, unit="m")
        require_positive("max_radius", self.max_radius, unit="m")
        require_at_least("max_radius", self.max_radius, self.first_radius, unit="m")

    @property
    def curvature(self) -> Curvature:
        """Hessian that the solver needs of an objective."""
        return "exact"

    def minimise(self, objective: Objective, start: Pose) -> Solution:
        """Return the best pose found from `start`, with the history of all evaluations.

        A last step below the tolerance is taken without an evaluation.

        Steps rotate about the origin of the target's frame, so the points should lie around it,
        within a few rotation scales.
        """
        scale = np.array(
            [1.0, 1.0, 1.0, self.rotation_scale, self.rotation_scale, self.rotation_scale]
        )
        squares = np.outer(scale, scale)
        pose, radius = start, self.first_radius
        quadratic = objective.linearise(pose)
        history = [Iteration(quadratic.value, _norm(quadratic, scale), 0.0, True, pose)]
        if quadratic.is_empty:
            return Solution(pose, quadratic, StopReason.EMPTY_OBJECTIVE, tuple(history))

        while len(history) < self.criteria.max_iterations:
            gradient = quadratic.gradient / scale
            if _length(gradient) < self.criteria.gradient_tolerance:
                return Solution(pose, quadratic, StopReason.GRADIENT_SMALL, tuple(history))
            step, predicted = trust_step(gradient, quadratic.hessian / squares, radius)
            step_norm = _length(step)
            if step_norm < self.criteria.step_tolerance:
                # A step that the radius limits does not lead to the minimum.
                if step_norm < 0.99 * radius:
                    pose, quadratic = pose.retract(step / scale), quadratic.after(step / scale)
                return Solution(pose, quadratic, StopReason.STEP_SMALL, tuple(history))

            tried_pose = pose.retract(step / scale)
            tried = objective.linearise(tried_pose)
            gain = (quadratic.value - tried.value) / predicted
            accepted = gain > _ACCEPTED_GAIN
            history.append(
                Iteration(tried.value, _norm(tried, scale), step_norm, accepted, tried_pose)
            )
            radius = self._next_radius(radius, step_norm, gain)
            if accepted:
                pose, quadratic = tried_pose, tried
        return Solution(pose, quadratic, StopReason.ITERATION_LIMIT, tuple(history))

    def _next_radius(self, radius: float, step_norm: float, gain: float) -> float:
        # Written so that NaN shortens the next step too.
        if not gain >= 0.25:
            return 0.25 * step_norm
        if gain > 0.75 and step_norm > 0.8 * radius:
            return min(2.0 * radius, self.max_radius)
        return radius


def _norm(quadratic: Quadratic, scale: Vector) -> float:
    return _length(quadratic.gradient / scale)


def _length(vector: Vector) -> float:
    # For six numbers numpy.linalg.norm takes three times as long.
    return math.sqrt(float(vector @ vector))


def trust_step(gradient: Vector, hessian: Matrix, radius: float) -> tuple[Vector, float]:
    """Return the Newton step within `radius` and its predicted decrease, both with ``|H|``."""
    eigenvalues, axes = np.linalg.eigh(hessian)
    magnitudes = np.abs(eigenvalues)
    largest = float(magnitudes.max())
    if largest == 0.0:
        # A slope without any curvature: step to the edge of the trust region.
        largest = _length(gradient) / (_MIN_CURVATURE * radius)
    curvatures = np.maximum(magnitudes, _MIN_CURVATURE * largest)
    along = axes.T @ gradient
    damping = _damping(along, curvatures, radius)
    coefficients = -along / (curvatures + damping)
    # Predicted with the positive curvatures, which never predict more.
    predicted = -(along @ coefficients + 0.5 * curvatures @ coefficients**2)
    return axes @ coefficients, float(predicted)


def _damping(along: Vector, curvatures: Vector, radius: float) -> float:
    """Return the minimum damping that keeps the step within `radius`, by Newton on 1 / norm."""
    damping = 0.0
    for _ in range(20):
        shifted = curvatures + damping
        norm = _length(along / shifted)
        if norm <= radius * 1.01:
            break
        slope = float(np.sum(along**2 / shifted**3)) / norm
        damping += (norm / radius - 1.0) * norm / slope
    return damping
