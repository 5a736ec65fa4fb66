from dataclasses import dataclass

import numpy as np
import pytest

from reference.samples import gaussians, yaw_pose
from scanlock.geometry.pose import Pose
from scanlock.optimisation.objectives.gaussian_scores import GaussiansToGaussians
from scanlock.optimisation.solvers.bfgs import QuasiNewton
from scanlock.optimisation.solvers.criteria import ConvergenceCriteria
from scanlock.optimisation.solvers.iterate import iterate
from scanlock.optimisation.solvers.line_search import LinePoint, LineStep, StrongWolfe
from scanlock.optimisation.solvers.line_search_globalisation import LineSearchGlobalisation
from scanlock.optimisation.solvers.more_thuente import MoreThuente

_ROTATION_SCALE = 5.0
_SCALE = np.array([1.0, 1.0, 1.0, _ROTATION_SCALE, _ROTATION_SCALE, _ROTATION_SCALE])
_START = Pose.from_step(np.array([0.4, -0.3, 0.2, 0.05, -0.08, 0.1]))


def _objective():
    rng = np.random.default_rng(3)
    target = gaussians(rng, 60)
    source = target.transformed(yaw_pose(0.03, (-0.1, 0.1, 0.0)))
    return GaussiansToGaussians(target=target, source=source)


def _minimised(search, directions, start=_START, max_iterations=100, objective=None):
    criteria = ConvergenceCriteria(max_iterations=max_iterations)
    globalisation = LineSearchGlobalisation(search, 10.0, directions)
    return iterate(objective or _objective(), start, criteria, _ROTATION_SCALE, globalisation)


class _Fixed:
    """One direction, and a record of its updates."""

    def __init__(self, direction):
        self._direction = direction
        self.updates = []

    def direction(self, gradient, hessian):
        return self._direction

    def update(self, step, change):
        self.updates.append((step, change))

    def reset(self):
        return False


@dataclass(frozen=True, kw_only=True)
class _Recorder:
    """Records slopes along a direction and their differences, and steps by a given length."""

    seen: list
    length: float = 1.0
    max_trials: int = 1

    def search(self, along, first, longest):
        for length in (0.0, 0.3, 1.0):
            h = 1e-5
            expected = (along(length + h)[0] - along(length - h)[0]) / (2.0 * h)
            self.seen.append((along(length)[1], expected))
        return LineStep(LinePoint.at(along, self.length), True)


@pytest.mark.parametrize("direction", [(0.5, -0.3, 0.2, 3.0, -2.0, 4.0), (0, 0, 0, 1.0, 2.0, 3.0)])
def test_slopes_along_the_curve_of_a_step_match_differences(direction):
    seen = []
    _minimised(_Recorder(seen=seen), _Fixed(np.array(direction)), max_iterations=2)
    slopes, expected = np.transpose(seen)
    np.testing.assert_allclose(slopes, expected, rtol=1e-6, atol=1e-9)


def test_the_change_of_gradient_is_for_steps_from_one_pose():
    objective, directions = _objective(), _Fixed(np.array([0.1, -0.2, 0.3, 3.0, -2.0, 1.0]))
    _minimised(_Recorder(seen=[]), directions, max_iterations=2, objective=objective)
    [(step, change)] = directions.updates

    def gradient_at(step):
        gradient, h = np.empty(6), 1e-5
        for axis in np.eye(6):
            ahead, behind = (
                objective.linearise(_START.retract((step + sign * h * axis) / _SCALE)).value
                for sign in (1.0, -1.0)
            )
            gradient += axis * (ahead - behind) / (2.0 * h) - gradient * axis
        return gradient

    np.testing.assert_allclose(change, gradient_at(step) - gradient_at(np.zeros(6)), atol=1e-8)


@pytest.mark.parametrize("search", [StrongWolfe(), MoreThuente()])
def test_steps_by_the_wolfe_conditions_have_positive_curvature(search):
    class Watched(QuasiNewton):
        def update(self, step, change):
            curvatures.append(step @ change)
            super().update(step, change)

    curvatures = []
    for x in (0.5, 2.0, 6.0):
        start = yaw_pose(0.2, (x, 1.0, 0.0))
        _minimised(search, Watched(0.5), start)
    assert len(curvatures) > 20
    assert min(curvatures) > 0.0


def test_a_search_that_ends_above_a_trial_returns_the_best_trial():
    directions = _Fixed(-np.array([0.4, -0.3, 0.2, 0.25, -0.4, 0.5]))
    solution = _minimised(_Recorder(seen=[], length=1e-3), directions, max_iterations=2)
    best = min(solution.history, key=lambda entry: entry.value)
    assert solution.pose == best.pose
    assert solution.quadratic.value == best.value
    assert [entry.pose for entry in solution.history if entry.accepted] == [_START, best.pose]


def test_misleading_directions_are_reset_once():
    class Stuck(_Fixed):
        resets = 0

        def reset(self):
            self.resets += 1
            return self.resets == 1

    uphill = _objective().linearise(_START).gradient / _SCALE
    directions = Stuck(uphill / np.linalg.norm(uphill))
    solution = _minimised(StrongWolfe(), directions)
    assert directions.resets == 2
    assert solution.pose == _START


def test_updates_build_the_inverse_hessian_of_a_parabola():
    rng = np.random.default_rng(0)
    root = rng.normal(size=(6, 6))
    hessian = root @ root.T + np.eye(6)
    directions, x = QuasiNewton(1.0), rng.normal(size=6)
    for _ in range(6):
        direction = directions.direction(hessian @ x, hessian)
        length = -(direction @ hessian @ x) / (direction @ hessian @ direction)
        directions.update(length * direction, length * hessian @ direction)
        x = x + length * direction
    # Exact searches along conjugate directions reach the minimum in six steps.
    np.testing.assert_allclose(x, np.zeros(6), atol=1e-8)
    target = rng.normal(size=6)
    np.testing.assert_allclose(
        directions.direction(target, hessian), -np.linalg.solve(hessian, target), rtol=1e-6
    )


def test_a_step_of_negative_curvature_does_not_update():
    directions = QuasiNewton(1.0)
    gradient = np.arange(1.0, 7.0)
    before = directions.direction(gradient, np.eye(6))
    directions.update(np.ones(6), -np.ones(6))
    directions.update(np.ones(6), np.zeros(6))
    np.testing.assert_array_equal(directions.direction(gradient, np.eye(6)), before)
    assert not directions.reset()
    directions.update(np.ones(6), np.ones(6))
    assert directions.reset()
    assert not directions.reset()
