"""Steps along descent directions, with lengths by a line search.

A step follows the curve ``y -> exp(a phi) y + a rho`` of `Pose.retract`, whose slope at ``a`` is
``g . (rho - a phi x rho, phi)`` with the gradient ``g`` there.
"""

from dataclasses import replace
from typing import Protocol

import numpy as np

from scanlock.arrays import Matrix, Vector
from scanlock.geometry.rotations import inverse_left_jacobian
from scanlock.optimisation.solvers.criteria import StopReason
from scanlock.optimisation.solvers.iterate import Evaluation, Path, norm
from scanlock.optimisation.solvers.line_search import Armijo, StrongWolfe
from scanlock.optimisation.solvers.more_thuente import MoreThuente

LineSearch = Armijo | StrongWolfe | MoreThuente
"""Settings of a line search."""

_ROUNDING = 1e-12
"""Relative difference below which values are equal."""


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


class LineSearchGlobalisation:
    """Globalisation of descent directions by a line search."""

    def __init__(self, line_search: LineSearch, max_step: float, directions: Directions) -> None:
        self._line_search = line_search
        self._max_step = max_step
        self._directions = directions

    def propose(self, gradient: Vector, hessian: Matrix) -> Vector:
        """Return the first step to try along the next direction."""
        return self._directions.direction(gradient, hessian)

    def advance(self, path: Path, step: Vector, step_norm: float) -> bool:
        """Move by the length that the line search finds, and update the directions."""
        search = replace(
            self._line_search, max_trials=min(path.remaining, self._line_search.max_trials)
        )
        line = _Line(path, step)
        length = search.search(line.value_and_slope, 1.0, self._max_step / step_norm).point.length
        if length * step_norm < path.criteria.step_tolerance:
            # The updates may mislead here: discard them before the end.
            return path.remaining == 0 or self._directions.reset()
        before = path.current.gradient
        path.move_to(line.at(length))
        taken = length * step
        self._directions.update(taken, _transported(path, taken) - before)
        return True

    def finish(self, path: Path, reason: StopReason) -> None:
        """Return to the best pose evaluated, at the end of a path that leads there."""
        values = [one.quadratic.value for one in path.evaluations]
        best, here = int(np.nanargmin(values)), path.current.quadratic.value
        if values[best] < here - _ROUNDING * abs(here):
            for one in path.evaluations[best:]:
                one.is_accepted = False
            path.move_to(path.evaluations[best])


class _Line:
    """The objective along a direction from the current pose of a path."""

    def __init__(self, path: Path, direction: Vector) -> None:
        self._path = path
        self._direction = direction
        self._by_length = {0.0: path.current}

    def at(self, length: float) -> Evaluation:
        """Return the evaluation at a step length."""
        if length not in self._by_length:
            step = length * self._direction
            self._by_length[length] = self._path.evaluate(step, norm(step))
        return self._by_length[length]

    def value_and_slope(self, length: float) -> tuple[float, float]:
        """Return value and slope at a step length."""
        at = self.at(length).quadratic
        rho, phi = self._direction[:3], self._direction[3:] / self._path.scale[3]
        tangent = np.concatenate([rho - length * np.cross(phi, rho), phi])
        return at.value, float(at.gradient @ tangent)


def _transported(path: Path, step: Vector) -> Vector:
    """Return the current scaled gradient for steps from the pose before a step to it."""
    rho, phi = step[:3], step[3:] / path.scale[3]
    gradient = path.current.quadratic.gradient
    # A change d of phi turns by J d more about the point that rho has shifted the origin to.
    turned = np.linalg.inv(inverse_left_jacobian(phi)).T @ (
        gradient[3:] - np.cross(rho, gradient[:3])
    )
    # A locked direction has no slope, and must not get one from the others.
    turned[gradient[3:] == 0.0] = 0.0
    return np.concatenate([gradient[:3], turned]) / path.scale
