"""Newton's method on poses, with a positive definite Hessian and a trust region.

Algorithm 1 of Das et al. 2013 steps by ``p + H^-1 g``. The minus sign is missing, and where the
Hessian is indefinite (most of the domain, away from the optimum) even ``-H^-1 g`` need not be a
descent direction. Here the eigenvalues of the Hessian are replaced by their absolute values, so
every step is one of descent. The trust radius follows the quality of the last prediction.
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

_MIN_CURVATURE = 1e-3
"""Minimum eigenvalue over the largest one, which bounds the step along flat directions."""

_MIN_GAIN = 1e-4
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
        region = TrustRegion(self.first_radius, self.max_radius)
        return iterate(objective, start, self.criteria, self.rotation_scale, region)


class TrustRegion:
    """Globalisation of Newton steps by a trust radius."""

    def __init__(self, first_radius: float, max_radius: float) -> None:
        self._radius = first_radius
        self._max_radius = max_radius
        self._step, self._predicted = np.zeros(6), 0.0

    def propose(self, gradient: Vector, hessian: Matrix) -> Vector:
        """Return the Newton step within the trust radius."""
        self._step, self._predicted = newton_step(gradient, hessian, self._radius)
        return self._step

    def advance(self, path: Path, step: Vector, step_norm: float) -> bool:
        """Move by a step whose decrease is sufficient, and adapt the radius."""
        here = path.current
        tried = path.evaluate(step, step_norm)
        gain = (here.quadratic.value - tried.quadratic.value) / self._predicted
        if gain > _MIN_GAIN:
            path.move_to(tried)
        # Written so that NaN shortens the next step too.
        if not gain >= 0.25:
            self._radius = 0.25 * step_norm
        elif gain > 0.75 and step_norm > 0.8 * self._radius:
            self._radius = min(2.0 * self._radius, self._max_radius)
        return True

    def finish(self, path: Path, reason: StopReason) -> None:
        """Take the last step, unless the radius limits it: then it does not lead to the minimum."""
        if reason is StopReason.STEP_SMALL and norm(self._step) < 0.99 * self._radius:
            path.finish_with(self._step)


def newton_step(gradient: Vector, hessian: Matrix, radius: float) -> tuple[Vector, float]:
    """Return the Newton step within a radius and its predicted decrease, both with ``|H|``."""
    eigenvalues, axes = np.linalg.eigh(hessian)
    magnitudes = np.abs(eigenvalues)
    largest = float(magnitudes.max())
    if largest == 0.0:
        # A slope without any curvature: step to the edge of the trust region.
        largest = norm(gradient) / (_MIN_CURVATURE * radius)
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
        length = norm(along / shifted)
        if length <= radius * 1.01:
            break
        slope = float(np.sum(along**2 / shifted**3)) / length
        damping += (length / radius - 1.0) * length / slope
    return damping
