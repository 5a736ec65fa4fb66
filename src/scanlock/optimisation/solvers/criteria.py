"""When a solver stops, and the words it says then."""

import enum
from dataclasses import dataclass

from scanlock.errors import require_at_least, require_positive


class StopReason(enum.Enum):
    """Why a solver stopped; the value is the sentence for people."""

    GRADIENT_SMALL = "gradient norm fell below the tolerance"
    STEP_SMALL = "step norm fell below the tolerance"
    GIVEN = "the pose was given"
    ITERATION_LIMIT = "iteration limit reached; the pose may still be improving"
    EMPTY_OBJECTIVE = "nothing meets at this pose; try a better initial pose or wider Gaussians"

    @property
    def is_converged(self) -> bool:
        """Whether the solver ended at a stationary point."""
        return self in (StopReason.GRADIENT_SMALL, StopReason.STEP_SMALL, StopReason.GIVEN)


@dataclass(frozen=True, kw_only=True, slots=True)
class ConvergenceCriteria:
    """Tolerances of the iteration; the defaults are those of Das et al. 2013, section VIII."""

    gradient_tolerance: float = 1e-6
    """Norm of the gradient of the normalised score, in the solver's scaled units."""

    step_tolerance: float = 1e-6
    """Norm of the step; metres, with rotations counted at the solver's lever arm."""

    max_iterations: int = 100
    """Evaluations of the objective allowed at one scale."""

    def __post_init__(self) -> None:
        require_positive("gradient_tolerance", self.gradient_tolerance)
        require_positive("step_tolerance", self.step_tolerance, unit="m")
        require_at_least("max_iterations", self.max_iterations, 1)
