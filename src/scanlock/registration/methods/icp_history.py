"""What ICP has tried so far, and when it has tried enough."""

import math
from dataclasses import dataclass, field

from scanlock.errors import require_at_least, require_count, require_positive
from scanlock.geometry.pose import Pose
from scanlock.optimisation.solvers.criteria import StopReason
from scanlock.optimisation.solvers.problem import Objective, Quadratic
from scanlock.optimisation.solvers.solution import Iteration, Solution
from scanlock.registration.methods.correspondences import Correspondences

_LONGEST_PERIOD = 8
"""Iterations after which poses are looked for that came back; longer cycles were never seen."""


@dataclass(frozen=True, kw_only=True, slots=True)
class IcpConvergenceCriteria:
    """The three ways to stop of the paper: near enough, no more change, or too long."""

    mean_distance: float | None = None
    """Stop when the pairs are this close on average [m]; None never asks."""

    relative_change: float = 0.0
    """Stop when translation and rotation change by no more than this share of themselves, 0.01
    in Zhang 1994. Shares of a motion near zero mean nothing, so `step` counts besides."""

    step_tolerance: float = 1e-6
    """Stop when the pose changes by less than this [m], rotations counted at the lever."""

    max_iterations: int = 200
    """Pairings allowed; from afar, closed forms creep."""

    def __post_init__(self) -> None:
        if self.mean_distance is not None:
            require_positive("mean_distance", self.mean_distance, unit="m")
        require_at_least("relative_change", self.relative_change, 0.0)
        require_positive("step_tolerance", self.step_tolerance, unit="m")
        require_count("max_iterations", self.max_iterations)

    def reason(self, history: list[Iteration]) -> tuple[StopReason | None, str]:
        """Return why to stop after the last of these iterations, and a note; None to go on."""
        last = history[-1]
        if self.mean_distance is not None and last.mean_distance <= self.mean_distance:
            return StopReason.STEP_SMALL, (
                f"stopped at a mean pair distance of {last.mean_distance:.4g} m, at most "
                f"{self.mean_distance:g} m"
            )
        if len(history) > 1:
            if last.step_norm < self.step_tolerance:
                return StopReason.STEP_SMALL, "stopped because the pose changed no more"
            metres, radians = last.pose.distance(history[-2].pose)
            distance, angle = last.pose.distance(Pose.identity())
            if (
                metres <= self.relative_change * distance
                and radians <= self.relative_change * angle
            ):
                return StopReason.STEP_SMALL, (
                    f"stopped because translation and rotation changed by at most "
                    f"{self.relative_change:g} of themselves"
                )
        if len(history) >= self.max_iterations:
            return StopReason.ITERATION_LIMIT, f"stopped after {self.max_iterations} iterations"
        return None, ""


@dataclass(slots=True)
class IcpHistory:
    """The iterations so far, and the limits of their pairs."""

    rotation_scale: float
    """Distance at which a rotation counts as a translation [m]."""

    history: list[Iteration] = field(default_factory=list[Iteration])
    limits: list[float] = field(default_factory=list[float])
    notes: dict[str, None] = field(default_factory=dict[str, None])
    """What was found on the way: each once, in order."""

    held_from: int = 0
    """The iteration since which the limits of pairs are held at a least; 0 before."""

    def add(
        self, quadratic: Quadratic, pose: Pose, pairs: Correspondences, accepted: bool = True
    ) -> None:
        """Keep an iteration: the pose, its pairs, and the objective of these there."""
        moved = self.step_between(self.history[-1].pose, pose) if self.history else 0.0
        slope = math.hypot(*quadratic.gradient[:3], *(quadratic.gradient[3:] / self.rotation_scale))
        self.history.append(
            Iteration(
                quadratic.value, slope, moved, accepted, pose, pairs.mean_distance, len(pairs)
            )
        )
        self.limits.append(pairs.threshold)

    def step_between(self, one: Pose, other: Pose) -> float:
        """Return how far apart two poses are [m], rotations counted at the lever."""
        metres, radians = one.distance(other)
        return math.hypot(metres, self.rotation_scale * radians)

    def period(self, tolerance: float) -> int:
        """Return after how many iterations the last pose came back, within [m]; 0 if it did not.

        Poses from before limits were held do not count: other pairs led to them.
        """
        last = self.history[-1].pose
        for back in range(2, min(_LONGEST_PERIOD, len(self.history) - 1 - self.held_from) + 1):
            before = self.history[-1 - back].pose
            # The angle takes ten times as long as the distance, and hardly ever matters.
            if math.dist(before.translation, last.translation) >= tolerance:
                continue
            if self.step_between(before, last) < tolerance:
                return back
        return 0

    def hold(self) -> None:
        """Remember that from the next iteration on limits are held."""
        self.held_from = len(self.history)

    def settled_limit(self, settling: float, pose: Pose) -> float:
        """Return the limit of the last iteration [m]; infinite until a step was below this.

        The step that led to `pose`, which has no pairs yet, counts.
        """
        if not self.history:
            return math.inf
        steps = [iteration.step_norm for iteration in self.history[1:]]
        steps.append(self.step_between(self.history[-1].pose, pose))
        return self.limits[-1] if min(steps) < settling else math.inf

    def note(self, text: str) -> None:
        """Keep a note, unless it is empty or known."""
        if text:
            self.notes[text] = None

    def solution(
        self,
        pose: Pose,
        quadratic: Quadratic,
        reason: StopReason,
        objective: Objective | None = None,
    ) -> Solution:
        """Return where it ended and all that was kept."""
        return Solution(pose, quadratic, reason, tuple(self.history), tuple(self.notes), objective)
