"""State of an ICP run, its convergence criteria and the detection of cycles."""

import math
from dataclasses import dataclass, field

from scanlock.errors import require_at_least, require_count, require_positive
from scanlock.geometry.pose import Pose
from scanlock.optimisation.solvers.criteria import StopReason
from scanlock.optimisation.solvers.notes import LengthNote, Note
from scanlock.optimisation.solvers.problem import Objective, Quadratic
from scanlock.optimisation.solvers.solution import Iteration, Solution
from scanlock.registration.methods.icp.correspondences import Correspondences

_MAX_CYCLE_LENGTH = 8
"""Maximum length of a cycle of poses to detect [iterations]; longer ones were never observed."""


@dataclass(frozen=True, kw_only=True, slots=True)
class IcpConvergenceCriteria:
    """The three stopping criteria of Madhavan and Messina 2003: distance, change, iterations."""

    mean_distance: float | None = None
    """Mean distance of the correspondences at which to stop [m]; None to ignore it."""

    relative_change: float = 0.0
    """Change of translation and rotation at which to stop, as a ratio of both; 0.01 in Zhang 1994.
    Ratios of a motion near zero are meaningless, so `step_tolerance` applies as well."""

    step_tolerance: float = 1e-6
    """Change of the pose at which to stop [m], with rotations scaled to metres."""

    max_iterations: int = 200
    """Maximum number of iterations; closed forms converge slowly from far away."""

    def __post_init__(self) -> None:
        if self.mean_distance is not None:
            require_positive("mean_distance", self.mean_distance, unit="m")
        require_at_least("relative_change", self.relative_change, 0.0)
        require_positive("step_tolerance", self.step_tolerance, unit="m")
        require_count("max_iterations", self.max_iterations)

    def reason(self, iterations: list[Iteration]) -> tuple[StopReason | None, Note]:
        """Return why to stop after the last of these iterations, and a note; None to continue."""
        last = iterations[-1]
        if self.mean_distance is not None and last.mean_distance <= self.mean_distance:
            return StopReason.STEP_SMALL, LengthNote(
                "stopped at a mean distance of {:.4g} m, at most {:g} m",
                (last.mean_distance, self.mean_distance),
            )
        if len(iterations) > 1:
            if last.step_norm < self.step_tolerance:
                return StopReason.STEP_SMALL, "stopped because the pose no longer changed"
            metres, radians = last.pose.distance(iterations[-2].pose)
            distance, angle = last.pose.distance(Pose.identity())
            if (
                metres <= self.relative_change * distance
                and radians <= self.relative_change * angle
            ):
                return StopReason.STEP_SMALL, (
                    "stopped because translation and rotation changed by a ratio of at most "
                    f"{self.relative_change:g}"
                )
        if len(iterations) >= self.max_iterations:
            return StopReason.ITERATION_LIMIT, f"stopped after {self.max_iterations} iterations"
        return None, ""


@dataclass(slots=True)
class IcpHistory:
    """State of an ICP run: the current pose, and the iterations and thresholds so far."""

    pose: Pose
    """Current pose, target from source."""

    rotation_scale: float
    """Distance at which a rotation counts as a translation [m]."""

    max_threshold: float = math.inf
    """Upper bound of the distance threshold [m]; finite after a cycle of poses."""

    iterations: list[Iteration] = field(default_factory=list[Iteration])
    """Pose, objective and correspondences of each iteration."""

    thresholds: list[float] = field(default_factory=list[float])
    """Distance threshold of each iteration [m]."""

    notes: dict[Note, None] = field(default_factory=dict[Note, None])
    """Notes in order, without duplicates."""

    cycle_start: int = 0
    """First iteration that can be part of a cycle."""

    def add(
        self, quadratic: Quadratic, correspondences: Correspondences, accepted: bool = True
    ) -> None:
        """Add an iteration: the objective and the correspondences at the current pose."""
        step = self._step_to(self.pose) if self.iterations else 0.0
        gradient = quadratic.gradient
        gradient_norm = math.hypot(*gradient[:3], *(gradient[3:] / self.rotation_scale))
        self.iterations.append(
            Iteration(
                quadratic.value,
                gradient_norm,
                step,
                accepted,
                self.pose,
                correspondences.mean_distance,
                len(correspondences),
            )
        )
        self.thresholds.append(correspondences.threshold)

    def previous_threshold(self, switch_step: float) -> float:
        """Return the last threshold [m]; infinite until a step was below `switch_step` [m].

        The step to the current pose counts.
        """
        if not self.iterations:
            return math.inf
        steps = [iteration.step_norm for iteration in self.iterations[1:]]
        steps.append(self._step_to(self.pose))
        return self.thresholds[-1] if min(steps) < switch_step else math.inf

    def cycle_length(self, tolerance: float) -> int:
        """Return the number of iterations after which the last pose recurred; 0 if it did not.

        Parameters
        ----------
        tolerance : float [m]
            Maximum distance of recurring poses.
        """
        last = self.iterations[-1].pose
        longest = min(_MAX_CYCLE_LENGTH, len(self.iterations) - 1 - self.cycle_start)
        for length in range(2, longest + 1):
            before = self.iterations[-1 - length].pose
            # The angle takes ten times as long as the distance and is rarely needed.
            if math.dist(before.translation, last.translation) >= tolerance:
                continue
            if before.scaled_distance(last, self.rotation_scale) < tolerance:
                return length
        return 0

    def break_cycle(self, length: int) -> None:
        """Bound the threshold by the smallest one of a cycle of this length.

        Earlier poses are no longer part of a cycle, since they had other correspondences.
        """
        self.max_threshold = min(self.thresholds[-length:])
        self.cycle_start = len(self.iterations)
        self.note(
            LengthNote("poses recurred: distance threshold at most {:.3g} m", (self.max_threshold,))
        )

    def note(self, note: Note) -> None:
        """Add a note unless it is empty."""
        if note:
            self.notes[note] = None

    def solution(
        self,
        pose: Pose,
        quadratic: Quadratic,
        reason: StopReason,
        objective: Objective | None = None,
    ) -> Solution:
        """Return the solution with all iterations and notes."""
        iterations, notes = tuple(self.iterations), tuple(self.notes)
        return Solution(pose, quadratic, reason, iterations, notes, objective)

    def _step_to(self, pose: Pose) -> float:
        """Return the distance [m] from the pose of the last iteration."""
        return self.iterations[-1].pose.scaled_distance(pose, self.rotation_scale)
