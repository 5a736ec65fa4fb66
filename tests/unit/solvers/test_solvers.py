"""Solvers that stand in for each other end at the same minimum."""

import numpy as np
import pytest

from reference.samples import gaussians, yaw_pose
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.objectives.gaussian_scores import GaussiansToGaussians, PointsToGaussians
from scanlock.objectives.quadratic import Quadratic
from scanlock.objectives.restraint import Restraint
from scanlock.solvers.bfgs import Bfgs
from scanlock.solvers.levenberg_marquardt import LevenbergMarquardt
from scanlock.solvers.line_search import Armijo, StrongWolfe
from scanlock.solvers.more_thuente import MoreThuente
from scanlock.solvers.newton import Newton
from scanlock.solvers.stopping import Stopping, StopReason

_SOLVERS = {
    "newton": Newton(),
    "lm": LevenbergMarquardt(),
    "gauss-newton": LevenbergMarquardt(first_damping=0.0),
    "armijo": Bfgs(line_search=Armijo()),
    "wolfe": Bfgs(line_search=StrongWolfe()),
    "more-thuente": Bfgs(line_search=MoreThuente()),
}

_START = yaw_pose(0.02, (0.3, -0.2, 0.1))


def _d2d(curvature, seed=1):
    rng = np.random.default_rng(seed)
    scene = gaussians(rng, 60)
    moved = gaussians(rng, 5, spread=3.0)
    source = scene.transformed(yaw_pose(-0.05, (0.2, 0.1, 0.0)))
    assert len(moved)
    return GaussiansToGaussians(target=scene, source=source, curvature=curvature)


def _p2d(curvature, seed=2):
    rng = np.random.default_rng(seed)
    scene = gaussians(rng, 40)
    points = np.concatenate(
        [
            rng.multivariate_normal(m, c, 20)
            for m, c in zip(scene.means, scene.covariances, strict=True)
        ]
    )
    points.setflags(write=False)
    return PointsToGaussians(target=scene, points=points, curvature=curvature)


@pytest.mark.parametrize("objective", [_d2d, _p2d])
@pytest.mark.parametrize("name", _SOLVERS)
def test_all_solvers_end_at_the_same_minimum(name, objective):
    solver = _SOLVERS[name]
    expected = Newton().minimise(objective("exact"), _START)
    solution = solver.minimise(objective(solver.curvature), _START)
    assert solution.reason.is_converged
    assert solution.pose.is_close(expected.pose, translation=1e-5, rotation=1e-6)
    np.testing.assert_allclose(solution.quadratic.value, expected.quadratic.value, rtol=1e-9)


@pytest.mark.parametrize("name", _SOLVERS)
def test_the_pose_is_the_best_that_was_tried(name):
    solver = _SOLVERS[name]
    solution = solver.minimise(_d2d(solver.curvature), yaw_pose(0.1, (1.0, -0.5, 0.2)))
    values = [entry.value for entry in solution.history]
    # A line search may take a flatter place over one lower by rounding.
    np.testing.assert_allclose(solution.quadratic.value, min(values), rtol=1e-9)
    accepted = [entry.value for entry in solution.history if entry.accepted]
    assert accepted == sorted(accepted, reverse=True)
    assert solution.history[0].accepted
    assert [entry for entry in solution.history if entry.accepted][-1].pose == solution.pose


@pytest.mark.parametrize("name", _SOLVERS)
def test_where_nothing_meets_there_is_no_support(name):
    solver = _SOLVERS[name]
    away = yaw_pose(0.0, (1e3, 0.0, 0.0))
    solution = solver.minimise(_d2d(solver.curvature), away)
    assert solution.reason is StopReason.NO_SUPPORT
    assert solution.pose == away
    assert len(solution.history) == 1


@pytest.mark.parametrize("name", _SOLVERS)
def test_the_limit_of_evaluations_is_kept_but_for_one_search(name):
    solver = type(_SOLVERS[name])(stopping=Stopping(iterations=3))
    solution = solver.minimise(_d2d(solver.curvature), yaw_pose(0.1, (1.0, -0.5, 0.2)))
    assert solution.reason is StopReason.ITERATION_LIMIT
    assert len(solution.history) <= 3 + 30


@pytest.mark.parametrize("name", _SOLVERS)
def test_locked_directions_stay(name):
    solver = _SOLVERS[name]
    restrained = Restraint(dof="xy+yaw").on(_d2d(solver.curvature))
    solution = solver.minimise(restrained, _START)
    assert solution.reason.is_converged
    np.testing.assert_allclose(solution.pose.translation[2], _START.translation[2], atol=1e-12)
    np.testing.assert_allclose(solution.pose.rotation[2], [0.0, 0.0, 1.0], atol=1e-12)


class _Recorded:
    """An objective whose value along a curve is looked at."""

    def __init__(self, objective):
        self._objective = objective

    @property
    def count(self):
        return self._objective.count

    def linearise(self, pose):
        return self._objective.linearise(pose)


def test_the_slope_along_a_step_matches_differences():
    from scanlock.solvers.bfgs import _Walk

    walk = _Walk(_Recorded(_d2d("convex")), Pose.from_step(np.full(6, 0.05)), 20.0)
    along = walk.along(np.array([0.5, -0.3, 0.2, 3.0, -2.0, 4.0]))
    for length in (0.0, 0.1, 0.4):
        h = 1e-5
        expected = (along(length + h)[0] - along(length - h)[0]) / (2.0 * h)
        np.testing.assert_allclose(along(length)[1], expected, rtol=1e-6, atol=1e-9)


class _Bowl:
    """A value that no shift along x changes."""

    count = 1

    def linearise(self, pose):
        y = pose.translation[1]
        gradient, hessian = np.zeros(6), np.zeros((6, 6))
        gradient[1], hessian[1, 1] = 2.0 * y, 2.0
        return Quadratic(1.0 + y * y, gradient, hessian)


@pytest.mark.parametrize("name", _SOLVERS)
def test_a_direction_that_nothing_holds_is_left_alone(name):
    solution = _SOLVERS[name].minimise(_Bowl(), yaw_pose(0.0, (2.0, 1.5, 0.0)))
    assert solution.reason.is_converged
    np.testing.assert_allclose(solution.pose.translation, [2.0, 0.0, 0.0], atol=1e-5)


def test_settings_out_of_range_are_refused():
    with pytest.raises(InvalidInput, match="growth"):
        LevenbergMarquardt(growth=1.0)
    with pytest.raises(InvalidInput, match="lever must be positive"):
        LevenbergMarquardt(lever=0.0)
    with pytest.raises(InvalidInput, match="first_step must be positive"):
        Bfgs(first_step=0.0)
