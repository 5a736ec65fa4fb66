"""Coarse-to-fine schedule: the same objective over Gaussians with less and less smoothing.

Adding an isotropic covariance to both sets of Gaussians smooths the score itself, and widens its
basin of convergence to the width of the smoothing. Das et al. 2013 use a single scale; Das and
Waslander 2012 vary the number of k-means clusters instead.
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
from scanlock.optimisation.solvers.staged import staged_solvers


@dataclass(frozen=True, kw_only=True, slots=True)
class Scale:
    """One scale of a schedule: the smoothing of the score and the size of the clusters."""

    smoothing: float
    """Standard deviation added to every Gaussian [m]; 0 for none."""

    max_radius: float
    """Maximum radius of a cluster [m]; larger clusters are split."""

    weight_power: float = 0.5
    """Exponent of the number of points in the weight of a Gaussian; D2D only."""

    starts_here: bool = False
    """Whether one more refinement of the initial pose starts at this scale. The first scale always
    starts one."""

    def __post_init__(self) -> None:
        require_at_least("weight_power", self.weight_power, 0.0)
        require_at_least("smoothing", self.smoothing, 0.0, unit="m")
        require_positive("max_radius", self.max_radius, unit="m")


DEFAULT_SCALES = (
    Scale(smoothing=8.0, max_radius=6.0),
    Scale(smoothing=4.0, max_radius=6.0),
    Scale(smoothing=2.0, max_radius=3.0, starts_here=True),
    Scale(smoothing=1.0, max_radius=3.0),
    Scale(smoothing=0.0, max_radius=1.5, weight_power=0.25),
)
"""The default schedule.

The smoothing of the first scale sets the basin, about 10 m and 60 degrees; the cluster radius of
the last scale sets the precision. Near objects have many points. They dominate the smoothed scales
and widen the basin; the last scale gives more weight to far objects, which constrain the rotation.
With little overlap, 8 m of smoothing pulls the scans towards a common centre, even from the true
pose; the refinement that starts at 2 m is free of that.
"""

PAPER_SCALES = (Scale(smoothing=0.0, max_radius=3.0),)
"""The single scale of Das et al. 2013, without smoothing."""


@dataclass(frozen=True, kw_only=True, slots=True)
class CoarseToFine:
    """Settings of the schedule."""

    scales: tuple[Scale, ...] = DEFAULT_SCALES
    """Scales, coarsest first."""

    solver: Solver = field(default_factory=Newton)
    """Solver at each scale."""

    coarse_tolerance: float = 0.01
    """Step tolerance of all scales but the last, as a fraction of their smoothing."""

    def __post_init__(self) -> None:
        for name, values in (
            ("smoothing", [scale.smoothing for scale in self.scales]),
            ("max_radius", [scale.max_radius for scale in self.scales]),
        ):
            if not values or values != sorted(values, reverse=True):
                raise InvalidInput(f"{name} must not increase from scale to scale, got {values}")
        require_fraction("coarse_tolerance", self.coarse_tolerance)

    def minimise(self, objective_at: Callable[[int], Objective], start: Pose) -> Solution:
        """Return the best solution of the last scale, with the history of all refinements.

        Parameters
        ----------
        objective_at : callable
            Returns the objective of a scale by its index.
        start : Pose
            Initial pose of every refinement. It is returned if the objective of the last scale
            is empty.
        """
        objective_at = functools.cache(objective_at)
        minima: list[tuple[int, Pose]] = []
        solutions: list[Solution] = []
        history: list[Iteration] = []
        for first, scale in enumerate(self.scales):
            if first == 0 or scale.starts_here:
                solution, steps = self._refine(objective_at, first, start, minima)
                history += steps
                if solution is not None:
                    solutions.append(solution)
        best = min(solutions, key=lambda one: one.quadratic.value)
        pose = start if best.reason is StopReason.EMPTY_OBJECTIVE else best.pose
        return replace(best, pose=pose, history=tuple(history))

    def _refine(
        self,
        objective_at: Callable[[int], Objective],
        first: int,
        start: Pose,
        minima: list[tuple[int, Pose]],
    ) -> tuple[Solution | None, list[Iteration]]:
        """Refine a pose from the scale `first` to the last.

        The solution is None if a scale ends at the minimum of an earlier refinement. Otherwise
        scale index and pose of each minimum are appended to `minima`.
        """
        solution, history, own_minima = None, list[Iteration](), list[tuple[int, Pose]]()
        solvers = staged_solvers(
            self.solver, [self.coarse_tolerance * scale.smoothing for scale in self.scales]
        )
        for index in range(first, len(self.scales)):
            solver = solvers[index]
            solution = solver.minimise(objective_at(index), start)
            history += solution.history
            start = solution.pose
            # Each of the two stopped within one step of the minimum.
            same = 2.0 * solver.criteria.step_tolerance
            if any(
                at == index and start.scaled_distance(pose, solver.rotation_scale) <= same
                for at, pose in minima
            ):
                return None, history
            own_minima.append((index, start))
        minima += own_minima
        return solution, history
