"""Newton's method with a line search in place of a trust region.

The normal distributions transform was published so: the Hessian is made positive, and the search
of More and Thuente chooses how far to go.
"""

from dataclasses import dataclass, field

from scanlock.arrays import Matrix, Vector
from scanlock.errors import require_positive
from scanlock.geometry.pose import Pose
from scanlock.optimisation.solvers.criteria import ConvergenceCriteria
from scanlock.optimisation.solvers.line_descent import LineDescent, LineSearch
from scanlock.optimisation.solvers.more_thuente import MoreThuente
from scanlock.optimisation.solvers.newton import trust_step
from scanlock.optimisation.solvers.problem import Curvature, Objective
from scanlock.optimisation.solvers.solution import Solution


@dataclass(frozen=True, kw_only=True, slots=True)
class LineSearchNewton:
    """Settings of the Newton solver with a line search."""

    criteria: ConvergenceCriteria = field(default_factory=ConvergenceCriteria)
    """Tolerances and the limit of evaluations."""

    line_search: LineSearch = field(default_factory=MoreThuente)
    """Chooses the length of each step."""

    rotation_scale: float = 20.0
    """Distance at which a rotation counts as a translation [m]; about the range of a scan."""

    max_step: float = 10.0
    """Longest step ever [m, rotations at the lever arm]."""

    def __post_init__(self) -> None:
        require_positive("lever", self.rotation_scale, unit="m")
        require_positive("longest_step", self.max_step, unit="m")

    @property
    def curvature(self) -> Curvature:
        """The Hessian that the solver wants of an objective."""
        return "exact"

    def minimise(self, objective: Objective, start: Pose) -> Solution:
        """Return the best pose found from `start`, with every evaluation on the way."""
        descent = LineDescent(
            criteria=self.criteria,
            line_search=self.line_search,
            rotation_scale=self.rotation_scale,
            max_step=self.max_step,
        )
        return descent.minimise(objective, start, RepairedNewton(self.max_step))


class RepairedNewton:
    """Directions by the Hessian with the magnitudes of its eigenvalues; nothing is learnt."""

    def __init__(self, max_step: float) -> None:
        self._longest_step = max_step

    def direction(self, gradient: Vector, hessian: Matrix) -> Vector:
        """Return the step of Newton's method, repaired as in `trust_step`."""
        return trust_step(gradient, hessian, self._longest_step)[0]

    def learn(self, step: Vector, change: Vector) -> None:
        """Take note of nothing: the next Hessian is exact."""

    def forget(self) -> bool:
        """Return False: nothing was learnt."""
        return False
