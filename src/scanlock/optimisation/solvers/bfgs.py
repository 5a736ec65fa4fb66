"""The method of Broyden, Fletcher, Goldfarb and Shanno on poses, with a line search.

It needs no Hessian: the gradients of the steps taken build the inverse of one (Nocedal & Wright
2006, algorithm 6.1).
"""

from dataclasses import dataclass, field

import numpy as np

from scanlock.arrays import Matrix, Vector
from scanlock.errors import require_positive
from scanlock.geometry.pose import Pose
from scanlock.optimisation.solvers.criteria import ConvergenceCriteria
from scanlock.optimisation.solvers.line_descent import LineDescent, LineSearch
from scanlock.optimisation.solvers.line_search import StrongWolfe
from scanlock.optimisation.solvers.problem import Curvature, Objective
from scanlock.optimisation.solvers.solution import Solution

_LEAST_BEND = 1e-10
"""Share of the lengths of a step and of its change of gradient below which their product tells
nothing of curvature."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Bfgs:
    """Settings of the quasi-Newton solver."""

    criteria: ConvergenceCriteria = field(default_factory=ConvergenceCriteria)
    """Tolerances and the limit of evaluations."""

    line_search: LineSearch = field(default_factory=StrongWolfe)
    """Chooses the length of each step."""

    rotation_scale: float = 20.0
    """Distance at which a rotation counts as a translation [m]; about the range of a scan."""

    first_step: float = 0.5
    """Length of the first step tried [m, rotations at the lever arm]: nothing is known yet of the
    curvature."""

    max_step: float = 10.0
    """Longest step ever [m, rotations at the lever arm]."""

    def __post_init__(self) -> None:
        require_positive("lever", self.rotation_scale, unit="m")
        require_positive("first_step", self.first_step, unit="m")
        require_positive("longest_step", self.max_step, unit="m")

    @property
    def curvature(self) -> Curvature:
        """The cheaper Hessian: none is used."""
        return "convex"

    def minimise(self, objective: Objective, start: Pose) -> Solution:
        """Return the best pose found from `start`, with every evaluation on the way."""
        descent = LineDescent(
            criteria=self.criteria,
            line_search=self.line_search,
            rotation_scale=self.rotation_scale,
            max_step=self.max_step,
        )
        return descent.minimise(objective, start, QuasiNewton(self.first_step))


class QuasiNewton:
    """Directions by an inverse Hessian that is learnt on the way."""

    def __init__(self, first_step: float) -> None:
        self._first_step = first_step
        self._inverse: Matrix | None = None

    def direction(self, gradient: Vector, hessian: Matrix) -> Vector:
        """Return the step to the minimum of what was learnt; down the gradient before that."""
        if self._inverse is None:
            return -gradient * (self._first_step / float(np.linalg.norm(gradient)))
        return -self._inverse @ gradient

    def learn(self, step: Vector, change: Vector) -> None:
        """Update the inverse Hessian, unless the step tells nothing of it or bends downwards."""
        bend = float(step @ change)
        if bend <= _LEAST_BEND * float(np.linalg.norm(step) * np.linalg.norm(change)):
            return
        if self._inverse is None:
            # Nocedal & Wright, equation 6.20: the first guess has the size of what was seen.
            self._inverse = np.eye(6) * bend / float(change @ change)
        left = np.eye(6) - np.outer(step, change) / bend
        self._inverse = left @ self._inverse @ left.T + np.outer(step, step) / bend

    def forget(self) -> bool:
        """Forget the inverse Hessian, and tell whether there was one."""
        known, self._inverse = self._inverse is not None, None
        return known
