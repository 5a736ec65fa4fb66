"""Newton's method with a line search in place of a trust region.

NDT is published with it: a positive definite Hessian and the line search of More and Thuente.
"""

from dataclasses import dataclass, field

from scanlock.arrays import Matrix, Vector
from scanlock.errors import require_positive
from scanlock.geometry.pose import Pose
from scanlock.optimisation.solvers.criteria import ConvergenceCriteria
from scanlock.optimisation.solvers.iterate import iterate
from scanlock.optimisation.solvers.line_search_globalisation import (
    LineSearch,
    LineSearchGlobalisation,
)
from scanlock.optimisation.solvers.more_thuente import MoreThuente
from scanlock.optimisation.solvers.newton import newton_step
from scanlock.optimisation.solvers.problem import Curvature, Objective
from scanlock.optimisation.solvers.solution import Solution


@dataclass(frozen=True, kw_only=True, slots=True)
class LineSearchNewton:
    """Settings of the Newton solver with a line search."""

    criteria: ConvergenceCriteria = field(default_factory=ConvergenceCriteria)
    """Convergence criteria."""

    line_search: LineSearch = field(default_factory=MoreThuente)
    """Line search that chooses the length of each step."""

    rotation_scale: float = 20.0
    """Distance at which a rotation counts as a translation [m]; about the range of a scan."""

    max_step: float = 10.0
    """Maximum step [m]; rotations count at the rotation scale."""

    def __post_init__(self) -> None:
        require_positive("rotation_scale", self.rotation_scale, unit="m")
        require_positive("max_step", self.max_step, unit="m")

    @property
    def curvature(self) -> Curvature:
        """Hessian that the solver needs of an objective."""
        return "exact"

    def minimise(self, objective: Objective, start: Pose) -> Solution:
        """Return the best pose found from `start`, with the history of all evaluations."""
        directions = NewtonDirections(self.max_step)
        search = LineSearchGlobalisation(self.line_search, self.max_step, directions)
        return iterate(objective, start, self.criteria, self.rotation_scale, search)


class NewtonDirections:
    """Descent directions by the Hessian with the absolute values of its eigenvalues."""

    def __init__(self, max_step: float) -> None:
        self._max_step = max_step

    def direction(self, gradient: Vector, hessian: Matrix) -> Vector:
        """Return the Newton step of length `max_step` at most."""
        return newton_step(gradient, hessian, self._max_step)[0]

    def update(self, step: Vector, change: Vector) -> None:
        """Do nothing: the next Hessian is exact."""

    def reset(self) -> bool:
        """Return False: there is nothing to reset."""
        return False
