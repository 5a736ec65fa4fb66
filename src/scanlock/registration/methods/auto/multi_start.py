"""Multi-start refinement: D2D from many hypotheses, the worse ones dropped after each scale."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

from scanlock.errors import InvalidInput, require_count, require_fraction, require_positive
from scanlock.geometry.pose import Pose
from scanlock.models.gaussians import Gaussians
from scanlock.optimisation.objectives.constraints import Constraints
from scanlock.optimisation.objectives.gaussian_scores import GaussiansToGaussians
from scanlock.optimisation.solvers.criteria import ConvergenceCriteria, StopReason
from scanlock.optimisation.solvers.newton import Newton
from scanlock.optimisation.solvers.problem import Objective
from scanlock.optimisation.solvers.solution import Iteration, Solution
from scanlock.optimisation.solvers.solver import Solver
from scanlock.optimisation.solvers.staged import staged_solvers
from scanlock.registration.methods.coarse_to_fine import Scale
from scanlock.registration.search.hypothesis import Hypothesis, distinct_rows

HYPOTHESIS_SCALES = (
    Scale(smoothing=1.0, max_radius=3.0, weight_power=0.25),
    Scale(smoothing=0.0, max_radius=1.5, weight_power=0.25),
)
"""Scales for hypotheses within 2 m and a few degrees of the true pose.

More smoothing would pull scans with little overlap towards a common centre. The small weight power
limits the weight of near objects, which have many points and may move with the sensor: the person
that carries it, or the vehicle.
"""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class RefinedHypothesis:
    """The refinement of one hypothesis.

    Attributes
    ----------
    proposed_by : str
        Origin of the hypothesis.
    solution : Solution
        Pose, objective and history after the refinement.
    """

    proposed_by: str
    solution: Solution


@dataclass(frozen=True, kw_only=True, slots=True)
class MultiStart:
    """Settings of the multi-start refinement by SGC-NDT D2D."""

    scales: tuple[Scale, ...] = HYPOTHESIS_SCALES
    """Scales, coarsest first."""

    solver: Solver = field(
        default_factory=lambda: Newton(criteria=ConvergenceCriteria(step_tolerance=5e-3))
    )
    """Solver at each scale. After a Newton step of 5 mm the remaining error is below 1 mm."""

    coarse_tolerance: float = 0.01
    """Step tolerance of all scales but the last, as a fraction of their smoothing."""

    min_score_ratio: float = 0.4
    """Minimum score of a hypothesis after each scale as a fraction of the best score."""

    max_kept: int = 4
    """Maximum number of hypotheses after each scale."""

    min_separation: tuple[float, float] = (0.5, 0.05)
    """Translation [m] and rotation [rad] below which two refined hypotheses are duplicates."""

    max_gaussians: int = 2500
    """Maximum number of Gaussians of the source at each scale, those of the most points first."""

    def __post_init__(self) -> None:
        require_count("max_gaussians", self.max_gaussians, 1)
        if not self.scales:
            raise InvalidInput("scales must not be empty")
        require_fraction("coarse_tolerance", self.coarse_tolerance)
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
        """Refine hypotheses scale by scale; keep the best distinct ones after each scale.

        Parameters
        ----------
        target, source : sequence of Gaussians
            One set per scale.
        hypotheses : iterable of Hypothesis
            Poses to refine.
        constraints : Constraints
            Locked directions and prior.
        plausibility : callable
            Factor of the score of a pose, in [0, 1].

        Returns
        -------
        refined : list of RefinedHypothesis
            The hypotheses kept after the last scale, best first.
        history : tuple of Iteration
            All evaluations, those of dropped hypotheses included.
        """
        history: list[Iteration] = []
        starts = [(one.proposed_by, one.pose) for one in hypotheses]
        refined: list[RefinedHypothesis] = []
        tolerances = [self.coarse_tolerance * scale.smoothing for scale in self.scales]
        solvers = staged_solvers(self.solver, tolerances)
        stages = zip(self.scales, solvers, target, source, strict=True)
        for scale, solver, target_set, source_set in stages:
            objective = constraints.applied_to(self._objective(scale, target_set, source_set))
            refined = [
                RefinedHypothesis(
                    proposed_by=proposed_by, solution=solver.minimise(objective, pose)
                )
                for proposed_by, pose in starts
            ]
            history += [step for one in refined for step in one.solution.history]
            refined = self._best(refined, plausibility)
            starts = [(one.proposed_by, one.solution.pose) for one in refined]
        return refined, tuple(history)

    def _objective(self, scale: Scale, target: Gaussians, source: Gaussians) -> Objective:
        return GaussiansToGaussians(
            target=target.inflated(scale.smoothing),
            source=source.with_most_points(self.max_gaussians).inflated(scale.smoothing),
            weight_power=scale.weight_power,
            curvature=self.solver.curvature,
        )

    def _best(
        self, refined: list[RefinedHypothesis], plausibility: Callable[[Pose], float]
    ) -> list[RefinedHypothesis]:
        """Return the distinct refined hypotheses with a sufficient score, best first."""
        scored = [
            (-one.solution.quadratic.value * plausibility(one.solution.pose), one)
            for one in refined
            if one.solution.reason is not StopReason.EMPTY_OBJECTIVE
        ]
        scored.sort(key=lambda pair: pair[0], reverse=True)
        # A distant prior can make all scores negative; the best is kept nevertheless.
        good = [
            one
            for rank, (score, one) in enumerate(scored)
            if rank == 0 or score >= self.min_score_ratio * scored[0][0]
        ]
        rows = distinct_rows([one.solution.pose for one in good], *self.min_separation)
        return [good[row] for row in rows[: self.max_kept]]
