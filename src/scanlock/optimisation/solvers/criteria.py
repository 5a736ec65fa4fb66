"""Convergence criteria of the solvers, and their reasons to stop."""

import enum
from dataclasses import dataclass

from scanlock.errors import require_at_least, require_positive


class StopReason(enum.Enum):
    """Reason of a solver to stop; the value is a sentence for the user."""

    GRADIENT_SMALL = "gradient norm fell below the tolerance"
    STEP_SMALL = "step norm fell below the tolerance"
    GIVEN = "the pose was given and not optimised"
    ITERATION_LIMIT = "iteration limit reached; the pose may still be improving"
    EMPTY_OBJECTIVE = "the objective has no terms at this pose"

    @property
    def is_converged(self) -> bool:
        """Whether the solver ended at a stationary point."""
        return self in (StopReason.GRADIENT_SMALL, StopReason.STEP_SMALL, StopReason.GIVEN)


@dataclass(frozen=True, kw_only=True, slots=True)
class ConvergenceCriteria:
    """Tolerances of a solver; the defaults are those of Das et al. 2013, section VIII."""

    gradient_tolerance: float = 1e-6
    """Tolerance of the gradient norm, in units of the objective per metre; rotations count at the
    solver's rotation scale."""

    step_tolerance: float = 1e-6
    """Tolerance of the step norm [m]; rotations count at the solver's rotation scale."""

    max_iterations: int = 100
    """Maximum number of evaluations of the objective."""

    def __post_init__(self) -> None:
        require_positive("gradient_tolerance", self.gradient_tolerance)
        require_positive("step_tolerance", self.step_tolerance, unit="m")
        require_at_least("max_iterations", self.max_iterations, 1)
