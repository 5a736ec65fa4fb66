"""Coarse to fine: the same objective over ever sharper Gaussians, each from the last pose.

Blurring both sets of Gaussians blurs the score itself, and a blurred score has a basin as wide
as the blur. Neither paper does this for clusters; Das and Waslander 2012 do it over the number
of k-means clusters.
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from scanlock.errors import InvalidInput, require_at_least, require_fraction, require_positive
from scanlock.geometry.pose import Pose
from scanlock.optimisation.solvers.criteria import StopReason
from scanlock.optimisation.solvers.newton import Newton
from scanlock.optimisation.solvers.problem import Objective
from scanlock.optimisation.solvers.solution import Iteration, Solution
from scanlock.optimisation.solvers.solver import Solver


@dataclass(frozen=True, kw_only=True, slots=True)
class Scale:
    """One step of the schedule: how blurred the score is, and how fine the scans are cut."""

    smoothing: float
    """Standard deviation added to every Gaussian [m]; 0 leaves them as they are."""

    max_radius: float
    """Clusters are cut to this radius [m]; under a blur, finer ones only cost time."""

    weight_power: float = 0.5
    """D2D: Gaussians weigh as their counts to this power."""

    is_entry: bool = False
    """Whether a descent of its own begins here; one always begins at the first scale."""

    def __post_init__(self) -> None:
        require_at_least("weight_power", self.weight_power, 0.0)
        require_at_least("smoothing", self.smoothing, 0.0, unit="m")
        require_positive("largest_radius", self.max_radius, unit="m")


DEFAULT_SCALES = (
    Scale(smoothing=8.0, max_radius=6.0),
    Scale(smoothing=4.0, max_radius=6.0),
    Scale(smoothing=2.0, max_radius=3.0, is_entry=True),
    Scale(smoothing=1.0, max_radius=3.0),
    Scale(smoothing=0.0, max_radius=1.5, weight_power=0.25),
)
"""The first blur sets the basin, about 10 m and 60 degrees; the last cut sets the precision.

Near objects, rich in points, lead the blurred scales and hold the basin; at the end the far ones
need a say, for they know the angles. Where the scans share little, a wide blur pulls their centres
together, away even from a true start; a second descent that begins at 2 m is spared that.
"""

PAPER_SCALES = (Scale(smoothing=0.0, max_radius=3.0),)
"""One scale, as in Das et al. 2013: the basin is then that of the sharp clusters."""


@dataclass(frozen=True, kw_only=True, slots=True)
class CoarseToFine:
    """Settings of the schedule."""

    scales: tuple[Scale, ...] = DEFAULT_SCALES
    """Coarsest first."""

    solver: Solver = field(default_factory=Newton)
    """Minimises at each scale."""

    coarse_tolerance: float = 0.01
    """A blurred scale stops at steps below this share of its blur: the next one goes on."""

    def __post_init__(self) -> None:
        blurs = [scale.smoothing for scale in self.scales]
        radii = [scale.max_radius for scale in self.scales]
        for name, values in (("blur", blurs), ("largest_radius", radii)):
            if not values or values != sorted(values, reverse=True):
                raise InvalidInput(f"{name} must not grow from scale to scale, got {values}")
        require_fraction("loose_step", self.coarse_tolerance)

    def minimise(self, objective_at: Callable[[int], Objective], start: Pose) -> Solution:
        """Return the best solution of the finest scale, with the history of all descents.

        Parameters
        ----------
        objective_at : callable
            Returns the objective at the scale of an index.
        start : Pose
            Where the coarsest scale begins; returned untouched if nothing meets at the finest.
        """
        objective_at = functools.cache(objective_at)
        ends: list[tuple[int, Pose]] = []
        solutions: list[Solution] = []
        history: list[Iteration] = []
        for entry, scale in enumerate(self.scales):
            if entry == 0 or scale.is_entry:
                solution, steps = self._descend(objective_at, entry, start, ends)
                history += steps
                if solution is not None:
                    solutions.append(solution)
        best = min(solutions, key=lambda one: one.quadratic.value)
        pose = start if best.reason is StopReason.EMPTY_OBJECTIVE else best.pose
        return replace(best, pose=pose, history=tuple(history))

    def _descend(
        self,
        objective_at: Callable[[int], Objective],
        entry: int,
        start: Pose,
        ends: list[tuple[int, Pose]],
    ) -> tuple[Solution | None, list[Iteration]]:
        """Return where a descent leads, or None once it is where an earlier one was.

        It adds the pose at the end of each of its scales to `ends`.
        """
        solution, history, own = None, list[Iteration](), list[tuple[int, Pose]]()
        for index in range(entry, len(self.scales)):
            solver = self._solver_at(self.scales[index])
            solution = solver.minimise(objective_at(index), start)
            history += solution.history
            start = solution.pose
            # Either stopped a step from the minimum at most, so this is one and the same.
            same = 2.0 * solver.criteria.step_tolerance
            if any(
                at == index and _gap(start, pose, solver.rotation_scale) <= same
                for at, pose in ends
            ):
                return None, history
            own.append((index, start))
        ends += own
        return solution, history

    def _solver_at(self, scale: Scale) -> Solver:
        criteria = self.solver.criteria
        step = max(criteria.step_tolerance, self.coarse_tolerance * scale.smoothing)
        return replace(self.solver, criteria=replace(criteria, step_tolerance=step))


def _gap(one: Pose, other: Pose, rotation_scale: float) -> float:
    metres, radians = one.distance(other)
    return metres + rotation_scale * radians
