"""Coarse to fine: the same objective over ever sharper Gaussians, each from the last pose.

Blurring both sets of Gaussians blurs the score itself, and a blurred score has a basin as wide
as the blur. Neither paper does this for clusters; Das and Waslander 2012 do it over the number
of k-means clusters.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

from scanlock.errors import InvalidInput, require_at_least
from scanlock.geometry.pose import Pose
from scanlock.objectives.quadratic import Objective
from scanlock.solvers.newton import Iteration, Newton, Solution


@dataclass(frozen=True, kw_only=True, slots=True)
class CoarseToFine:
    """Settings of the schedule."""

    blurs: tuple[float, ...] = (8.0, 4.0, 2.0, 1.0, 0.0)
    """Standard deviation added to every Gaussian at each scale, coarsest first [m].

    The first sets the basin, about as wide as itself; the last should be 0, the Gaussians as
    they are.
    """

    solver: Newton = field(default_factory=Newton)
    """Minimises at each scale."""

    def __post_init__(self) -> None:
        if not self.blurs or list(self.blurs) != sorted(self.blurs, reverse=True):
            raise InvalidInput(f"blurs must fall from coarse to fine, got {self.blurs}")
        for blur in self.blurs:
            require_at_least("blurs", blur, 0.0, unit="m")

    def minimise(self, objective_at: Callable[[float], Objective], start: Pose) -> Solution:
        """Return the solution of the finest scale, with the history of all of them.

        Parameters
        ----------
        objective_at : callable
            Returns the objective for a blur [m].
        start : Pose
            Where the coarsest scale begins.
        """
        history: list[Iteration] = []
        solution = self.solver.minimise(objective_at(self.blurs[0]), start)
        history.extend(solution.history)
        for blur in self.blurs[1:]:
            solution = self.solver.minimise(objective_at(blur), solution.pose)
            history.extend(solution.history)
        return Solution(solution.pose, solution.quadratic, solution.reason, tuple(history))
