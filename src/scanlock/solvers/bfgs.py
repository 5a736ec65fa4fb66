"""The method of Broyden, Fletcher, Goldfarb and Shanno on poses, with a line search.

It needs no Hessian: the gradients of the steps taken build one. A step moves along the curve
``y -> exp(a phi) y + a rho`` of `Pose.retract`, whose slope at ``a`` is
``g . (rho - a phi x rho, phi)`` with the gradient ``g`` there.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from scanlock.arrays import Matrix, Vector
from scanlock.errors import require_positive
from scanlock.geometry.pose import Pose
from scanlock.objectives.quadratic import Curvature, Objective, Quadratic
from scanlock.solvers.line_search import Along, Armijo, StrongWolfe
from scanlock.solvers.more_thuente import MoreThuente
from scanlock.solvers.solution import Iteration, Solution
from scanlock.solvers.stopping import Stopping, StopReason

LineSearch = Armijo | StrongWolfe | MoreThuente
"""Settings that choose the length of a step."""

_LEAST_BEND = 1e-10
"""Share of a step's own lengths below which its change of gradient tells nothing of curvature."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Bfgs:
    """Settings of the quasi-Newton solver."""

    stopping: Stopping = field(default_factory=Stopping)
    """Tolerances and the limit of evaluations."""

    line_search: LineSearch = field(default_factory=StrongWolfe)
    """Chooses the length of each step."""

    lever: float = 20.0
    """Distance at which a rotation counts as a translation [m]; about the range of a scan."""

    first_step: float = 0.5
    """Length of the first step tried [m, rotations at the lever arm]: nothing is known yet of the
    curvature."""

    def __post_init__(self) -> None:
        require_positive("lever", self.lever, unit="m")
        require_positive("first_step", self.first_step, unit="m")

    @property
    def curvature(self) -> Curvature:
        """The cheaper Hessian: none is used."""
        return "convex"

    def minimise(self, objective: Objective, start: Pose) -> Solution:
        """Return the best pose found from `start`, with every evaluation on the way."""
        walk = _Walk(objective, start, self.lever)
        if walk.is_void:
            return walk.solution(StopReason.NO_SUPPORT)
        inverse: Matrix | None = None
        while len(walk.history) < self.stopping.iterations:
            gradient = walk.gradient
            norm = float(np.linalg.norm(gradient))
            if norm < self.stopping.gradient:
                return walk.solution(StopReason.GRADIENT_SMALL)
            direction = (
                -gradient * self.first_step / norm if inverse is None else -inverse @ gradient
            )
            if direction @ gradient >= 0.0:
                inverse = None
                continue
            length = self.line_search.search(walk.along(direction), 1.0)
            step = length * direction
            if float(np.linalg.norm(step)) < self.stopping.step:
                if inverse is None or length > 0.0:
                    return walk.solution(StopReason.STEP_SMALL)
                # What was learnt of the curvature misleads here: begin anew, once.
                inverse = None
                continue
            change = walk.move(step) - gradient
            inverse = _updated(inverse, step, change)
        return walk.solution(StopReason.ITERATION_LIMIT)


class _Walk:
    """Where the solver stands, and every evaluation on the way there, in scaled units."""

    def __init__(self, objective: Objective, start: Pose, lever: float) -> None:
        self._objective = objective
        self._scale = np.array([1.0, 1.0, 1.0, lever, lever, lever])
        self._pose = start
        self._quadratic = objective.linearise(start)
        self._seen: dict[bytes, tuple[Quadratic, int]] = {}
        norm = float(np.linalg.norm(self.gradient))
        self.history = [Iteration(self._quadratic.value, norm, 0.0, True, start)]

    @property
    def gradient(self) -> Vector:
        return self._quadratic.gradient / self._scale

    @property
    def is_void(self) -> bool:
        at = self._quadratic
        return at.value == 0.0 and not at.gradient.any() and not at.hessian.any()

    def solution(self, reason: StopReason) -> Solution:
        return Solution(self._pose, self._quadratic, reason, tuple(self.history))

    def along(self, direction: Vector) -> Along:
        """Return the function that a line search sees."""

        def value_and_slope(length: float) -> tuple[float, float]:
            step = length * direction
            at = self._at(step)
            rho, phi = direction[:3], direction[3:] / self._scale[3]
            turned = np.concatenate([rho - length * np.cross(phi, rho), phi])
            return at.value, float(at.gradient @ turned)

        return value_and_slope

    def move(self, step: Vector) -> Vector:
        """Stand at a step from here, and return the gradient there."""
        self._quadratic = self._at(step)
        _, index = self._seen[step.tobytes()]
        self.history[index] = replace(self.history[index], accepted=True)
        self._pose = self.history[index].pose
        self._seen.clear()
        return self.gradient

    def _at(self, step: Vector) -> Quadratic:
        if not step.any():
            return self._quadratic
        key = step.tobytes()
        if key not in self._seen:
            pose = self._pose.retract(step / self._scale)
            at = self._objective.linearise(pose)
            self._seen[key] = at, len(self.history)
            norm = float(np.linalg.norm(at.gradient / self._scale))
            self.history.append(Iteration(at.value, norm, float(np.linalg.norm(step)), False, pose))
        return self._seen[key][0]


def _updated(inverse: Matrix | None, step: Vector, change: Vector) -> Matrix | None:
    """Return the inverse Hessian after a step, unless the step tells nothing of it."""
    bend = float(step @ change)
    if bend <= _LEAST_BEND * float(np.linalg.norm(step) * np.linalg.norm(change)):
        return inverse
    if inverse is None:
        # Nocedal & Wright 2006, equation 6.20: the first guess has the size of what was seen.
        inverse = np.eye(6) * bend / float(change @ change)
    left = np.eye(6) - np.outer(step, change) / bend
    return left @ inverse @ left.T + np.outer(step, step) / bend
