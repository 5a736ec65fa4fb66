"""Descent along directions, with step lengths by a line search.

A step follows the curve ``y -> exp(a phi) y + a rho`` of `Pose.retract`, whose slope at ``a`` is
``g . (rho - a phi x rho, phi)`` with the gradient ``g`` there.
"""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from scanlock.arrays import Matrix, Vector
from scanlock.errors import require_positive
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import inverse_left_jacobian
from scanlock.optimisation.solvers.criteria import ConvergenceCriteria, StopReason
from scanlock.optimisation.solvers.line_search import Armijo, LineFunction, StrongWolfe
from scanlock.optimisation.solvers.more_thuente import MoreThuente
from scanlock.optimisation.solvers.problem import Objective
from scanlock.optimisation.solvers.solution import Iteration, Solution

LineSearch = Armijo | StrongWolfe | MoreThuente
"""Settings of a line search."""


class Directions(Protocol):
    """Rule for descent directions, in scaled units; it may use the steps taken so far."""

    def direction(self, gradient: Vector, hessian: Matrix) -> Vector:
        """Return a (6,) descent direction, as long as the first step to try."""
        ...

    def update(self, step: Vector, change: Vector) -> None:
        """Update the rule with a (6,) step and the change of the gradient over it."""
        ...

    def reset(self) -> bool:
        """Discard all updates, and return whether there were any."""
        ...


@dataclass(frozen=True, kw_only=True, slots=True)
class LineDescent:
    """Settings of a descent by line search."""

    criteria: ConvergenceCriteria
    """Convergence criteria."""

    line_search: LineSearch
    """Line search that chooses the length of each step."""

    rotation_scale: float
    """Distance at which a rotation counts as a translation [m]."""

    max_step: float
    """Maximum step [m]; rotations count at the rotation scale."""

    def __post_init__(self) -> None:
        require_positive("rotation_scale", self.rotation_scale, unit="m")
        require_positive("max_step", self.max_step, unit="m")

    def minimise(self, objective: Objective, start: Pose, directions: Directions) -> Solution:
        """Return the best pose found from `start`, with the history of all evaluations."""
        walk = _Walk(objective, start, self.rotation_scale)
        if walk.is_empty:
            return walk.solution(StopReason.EMPTY_OBJECTIVE)
        while (left := self.criteria.max_iterations - len(walk.history)) > 0:
            gradient = walk.gradient
            if float(np.linalg.norm(gradient)) < self.criteria.gradient_tolerance:
                return walk.solution(StopReason.GRADIENT_SMALL)
            direction = directions.direction(gradient, walk.hessian)
            norm = float(np.linalg.norm(direction))
            if norm < self.criteria.step_tolerance:
                return walk.solution(StopReason.STEP_SMALL)
            search = replace(self.line_search, max_trials=min(left, self.line_search.max_trials))
            found = search.search(walk.along(direction), 1.0, self.max_step / norm)
            length = found.point.length
            if length * norm < self.criteria.step_tolerance:
                # The updates may mislead here: discard them before the end.
                if len(walk.history) < self.criteria.max_iterations and not directions.reset():
                    return walk.solution(StopReason.STEP_SMALL)
                continue
            directions.update(length * direction, walk.moved(length * direction) - gradient)
        return walk.solution(StopReason.ITERATION_LIMIT)


class _Walk:
    """Evaluations so far and the current pose, in scaled units."""

    def __init__(self, objective: Objective, start: Pose, rotation_scale: float) -> None:
        self._objective = objective
        self._scale = np.array([1.0, 1.0, 1.0, rotation_scale, rotation_scale, rotation_scale])
        self._index = 0
        self._quadratics = [objective.linearise(start)]
        self._trials: dict[bytes, int] = {}
        value, norm = self._quadratics[0].value, float(np.linalg.norm(self.gradient))
        self.history = [Iteration(value, norm, 0.0, True, start)]

    @property
    def gradient(self) -> Vector:
        return self._quadratics[self._index].gradient / self._scale

    @property
    def hessian(self) -> Matrix:
        return self._quadratics[self._index].hessian / np.outer(self._scale, self._scale)

    @property
    def is_empty(self) -> bool:
        return self._quadratics[0].is_empty

    def along(self, direction: Vector) -> LineFunction:
        """Return value and slope as a function of the step length."""

        def value_and_slope(length: float) -> tuple[float, float]:
            at = self._quadratics[self._tried(length * direction)]
            rho, phi = direction[:3], direction[3:] / self._scale[3]
            turned = np.concatenate([rho - length * np.cross(phi, rho), phi])
            return at.value, float(at.gradient @ turned)

        return value_and_slope

    def moved(self, step: Vector) -> Vector:
        """Move by an evaluated step; return the gradient there, for steps from the pose before."""
        self._index = self._tried(step)
        self.history[self._index] = replace(self.history[self._index], accepted=True)
        self._trials.clear()
        rho, phi = step[:3], step[3:] / self._scale[3]
        gradient = self._quadratics[self._index].gradient
        # A change d of phi turns by J d more about the point that rho has shifted the origin to.
        turned = np.linalg.inv(inverse_left_jacobian(phi)).T @ (
            gradient[3:] - np.cross(rho, gradient[:3])
        )
        # A locked direction has no slope, and must not get one from the others.
        turned[gradient[3:] == 0.0] = 0.0
        return np.concatenate([gradient[:3], turned]) / self._scale

    def solution(self, reason: StopReason) -> Solution:
        """Return the best pose evaluated, at the end of a path that leads there."""
        values = [entry.value for entry in self.history]
        best = int(np.nanargmin(values))
        if values[best] >= values[self._index] - _ROUNDING * abs(values[self._index]):
            best = self._index
        history = [
            replace(entry, accepted=index == best) if index >= best else entry
            for index, entry in enumerate(self.history)
        ]
        return Solution(history[best].pose, self._quadratics[best], reason, tuple(history))

    def _tried(self, step: Vector) -> int:
        """Return the index of the evaluation at a step from the current pose."""
        if not step.any():
            return self._index
        key = step.tobytes()
        if key not in self._trials:
            pose = self.history[self._index].pose.retract(step / self._scale)
            at = self._objective.linearise(pose)
            self._trials[key] = len(self.history)
            self._quadratics.append(at)
            norm = float(np.linalg.norm(at.gradient / self._scale))
            self.history.append(Iteration(at.value, norm, float(np.linalg.norm(step)), False, pose))
        return self._trials[key]


_ROUNDING = 1e-12
"""Relative difference below which values are equal."""
