"""The quasi-Newton method BFGS on poses, with a line search.

It needs no Hessian: the changes of the gradient approximate its inverse (Nocedal & Wright 2006,
algorithm 6.1).
"""

from dataclasses import dataclass, field

import numpy as np

from scanlock.arrays import Matrix, Vector
from scanlock.errors import require_positive
from scanlock.geometry.pose import Pose
from scanlock.optimisation.solvers.criteria import ConvergenceCriteria
from scanlock.optimisation.solvers.iterate import iterate, norm
from scanlock.optimisation.solvers.line_search import StrongWolfe
from scanlock.optimisation.solvers.line_search_globalisation import (
    LineSearch,
    LineSearchGlobalisation,
)
from scanlock.optimisation.solvers.problem import Curvature, Objective
from scanlock.optimisation.solvers.solution import Solution

_MIN_CURVATURE = 1e-10
"""Minimum product of a step and its change of gradient over that of their norms, for an update."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Bfgs:
    """Settings of the quasi-Newton solver."""

    criteria: ConvergenceCriteria = field(default_factory=ConvergenceCriteria)
    """Convergence criteria."""

    line_search: LineSearch = field(default_factory=StrongWolfe)
    """Line search that chooses the length of each step."""

    rotation_scale: float = 20.0
    """Distance at which a rotation counts as a translation [m]; about the range of a scan."""

    first_step: float = 0.5
    """Length of the first step tried [m], without knowledge of the curvature; rotations count at
    the rotation scale."""

    max_step: float = 10.0
    """Maximum step [m]; rotations count at the rotation scale."""

    def __post_init__(self) -> None:
        require_positive("rotation_scale", self.rotation_scale, unit="m")
        require_positive("first_step", self.first_step, unit="m")
        require_positive("max_step", self.max_step, unit="m")

    @property
    def curvature(self) -> Curvature:
        """Hessian that the solver asks an objective for: the cheaper one, since it uses none."""
        return "convex"

    def minimise(self, objective: Objective, start: Pose) -> Solution:
        """Return the best pose found from `start`, with the history of all evaluations."""
        directions = QuasiNewton(self.first_step)
        search = LineSearchGlobalisation(self.line_search, self.max_step, directions)
        return iterate(objective, start, self.criteria, self.rotation_scale, search)


class QuasiNewton:
    """Descent directions by an approximate inverse Hessian."""

    def __init__(self, first_step: float) -> None:
        self._first_step = first_step
        self._inverse: Matrix | None = None

    def direction(self, gradient: Vector, hessian: Matrix) -> Vector:
        """Return the quasi-Newton step; before the first update a step along the gradient."""
        if self._inverse is None:
            return -gradient * (self._first_step / norm(gradient))
        return -self._inverse @ gradient

    def update(self, step: Vector, change: Vector) -> None:
        """Update the inverse Hessian, unless the curvature along the step is not positive."""
        curvature = float(step @ change)
        if curvature <= _MIN_CURVATURE * norm(step) * norm(change):
            return
        if self._inverse is None:
            # Nocedal & Wright, equation 6.20: scale the first approximation.
            self._inverse = np.eye(6) * curvature / float(change @ change)
        left = np.eye(6) - np.outer(step, change) / curvature
        self._inverse = left @ self._inverse @ left.T + np.outer(step, step) / curvature

    def reset(self) -> bool:
        """Reset the inverse Hessian, and return whether there was one."""
        known, self._inverse = self._inverse is not None, None
        return known
