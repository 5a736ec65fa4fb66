"""Descents from many hypotheses, of which few are followed to the end."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

from scanlock.errors import InvalidInput, require_count, require_fraction, require_positive
from scanlock.geometry.pose import Pose
from scanlock.models.gaussians import Gaussians
from scanlock.optimisation.objectives.constraints import Constraints
from scanlock.optimisation.objectives.gaussian_scores import GaussiansToGaussians
from scanlock.optimisation.solvers.criteria import ConvergenceCriteria, StopReason
from scanlock.optimisation.solvers.newton import Newton
from scanlock.optimisation.solvers.solution import Iteration, Solution
from scanlock.optimisation.solvers.solver import Solver
from scanlock.optimisation.solvers.staged import with_tolerance
from scanlock.registration.methods.coarse_to_fine import Scale
from scanlock.registration.search.hypothesis import Hypothesis, distinct

HYPOTHESIS_SCALES = (
    Scale(smoothing=1.0, max_radius=3.0, weight_power=0.25),
    Scale(smoothing=0.0, max_radius=1.5, weight_power=0.25),
)
"""For starts within 2 m and a few degrees. A wider blur would pull scans that share little to where
their centres meet; and near objects, rich in points, may move with the sensor: its carrier, its
vehicle. So they do not lead here."""


@dataclass(frozen=True, slots=True, eq=False)
class RefinedHypothesis:
    """Where a hypothesis ended.

    Attributes
    ----------
    maker : str
        What proposed the hypothesis.
    solution : Solution
    """

    proposed_by: str
    solution: Solution


@dataclass(frozen=True, kw_only=True, slots=True)
class MultiStart:
    """Settings: SGC-NDT D2D, scale by scale, and which descents go on after each."""

    scales: tuple[Scale, ...] = HYPOTHESIS_SCALES
    """Coarsest first."""

    solver: Solver = field(
        default_factory=lambda: Newton(criteria=ConvergenceCriteria(step_tolerance=5e-3))
    )
    """Minimises at each scale. What is left after a step of 5 mm is a fraction of a millimetre, and
    the last stage goes on from there."""

    coarse_tolerance: float = 0.01
    """A blurred scale stops at steps below this share of its blur."""

    min_score_ratio: float = 0.4
    """A descent whose score at a scale is below this share of the best one's is given up."""

    max_kept: int = 4
    """How many go on after each scale, at most."""

    min_separation: tuple[float, float] = (0.5, 0.05)
    """Two descents that end closer than this are one [m, rad]."""

    def __post_init__(self) -> None:
        if not self.scales:
            raise InvalidInput("scales must not be empty")
        require_fraction("loose_step", self.coarse_tolerance)
        require_fraction("min_score_ratio", self.min_score_ratio)
        require_count("max_kept", self.max_kept, 1)
        for one, unit in zip(self.min_separation, ("m", "rad"), strict=True):
            require_positive("min_separation", one, unit=unit)

    def refine(
        self,
        target: Sequence[Gaussians],
        source: Sequence[Gaussians],
        hypotheses: Iterable[Hypothesis],
        constraints: Constraints,
        plausibility: Callable[[Pose], float],
    ) -> tuple[list[RefinedHypothesis], tuple[Iteration, ...]]:
        """Return the descents that went to the end, best first, and the history of all.

        Parameters
        ----------
        target, source : sequence of Gaussians
            One set for each scale.
        hypotheses : iterable of Hypothesis
            Where the descents begin.
        restraint : Restraint
        plausibility : callable
            What else speaks for a pose, from 1 down to 0: its factor to the score.
        """
        history: list[Iteration] = []
        running = [(one.proposed_by, one.pose) for one in hypotheses]
        ended: list[RefinedHypothesis] = []
        for index, scale in enumerate(self.scales):
            objective = constraints.applied_to(
                GaussiansToGaussians(
                    target=target[index].inflated(scale.smoothing),
                    source=source[index].inflated(scale.smoothing),
                    weight_power=scale.weight_power,
                    curvature=self.solver.curvature,
                )
            )
            solver = with_tolerance(self.solver, self.coarse_tolerance * scale.smoothing)
            ended = [
                RefinedHypothesis(proposed_by, solver.minimise(objective, pose))
                for proposed_by, pose in running
            ]
            history += [step for one in ended for step in one.solution.history]
            ended = self._best_of(ended, plausibility)
            running = [(one.proposed_by, one.solution.pose) for one in ended]
        return ended, tuple(history)

    def _best_of(
        self, ended: list[RefinedHypothesis], plausibility: Callable[[Pose], float]
    ) -> list[RefinedHypothesis]:
        """Return the distinct ones that are good enough to go on, best first."""
        scored = [
            (-one.solution.quadratic.value * plausibility(one.solution.pose), one)
            for one in ended
            if one.solution.reason is not StopReason.EMPTY_OBJECTIVE
        ]
        scored.sort(key=lambda pair: pair[0], reverse=True)
        # A prior far away can make all scores negative; the best goes on all the same.
        good = [
            one
            for rank, (score, one) in enumerate(scored)
            if rank == 0 or score >= self.min_score_ratio * scored[0][0]
        ]
        rows = distinct([one.solution.pose for one in good], *self.min_separation)
        return [good[row] for row in rows[: self.max_kept]]
