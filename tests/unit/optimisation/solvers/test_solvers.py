"""Contract of the interchangeable solvers."""

from itertools import pairwise

import numpy as np
import pytest

from reference.samples import gaussians, yaw_pose
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.optimisation.objectives.constraints import Constraints
from scanlock.optimisation.objectives.gaussian_scores import GaussiansToGaussians
from scanlock.optimisation.solvers.bfgs import Bfgs
from scanlock.optimisation.solvers.criteria import ConvergenceCriteria, StopReason
from scanlock.optimisation.solvers.levenberg_marquardt import LevenbergMarquardt
from scanlock.optimisation.solvers.line_search import Armijo, StrongWolfe
from scanlock.optimisation.solvers.line_search_newton import LineSearchNewton
from scanlock.optimisation.solvers.more_thuente import MoreThuente
from scanlock.optimisation.solvers.newton import Newton
from scanlock.optimisation.solvers.problem import Quadratic

_SOLVERS = {
    "newton": Newton(),
    "newton-armijo": LineSearchNewton(line_search=Armijo()),
    "newton-wolfe": LineSearchNewton(line_search=StrongWolfe()),
    "newton-more-thuente": LineSearchNewton(),
    "lm": LevenbergMarquardt(),
    "gauss-newton": LevenbergMarquardt(first_damping=0.0),
    "bfgs-armijo": Bfgs(line_search=Armijo()),
    "bfgs-wolfe": Bfgs(),
    "bfgs-more-thuente": Bfgs(line_search=MoreThuente()),
}
_ALL = pytest.mark.parametrize("solver", _SOLVERS.values(), ids=_SOLVERS)

_START = yaw_pose(0.02, (0.3, -0.2, 0.1))
_FARTHER = yaw_pose(0.1, (1.0, -0.5, 0.2))


def _d2d(curvature):
    target = gaussians(np.random.default_rng(1), 60)
    source = target.transformed(yaw_pose(-0.05, (0.2, 0.1, 0.0)))
    return GaussiansToGaussians(target=target, source=source, curvature=curvature)


class _Translations:
    """A function of the translation alone, with its gradient and a convex Hessian."""

    count = 1

    def __init__(self, function):
        self._function = function

    def linearise(self, pose):
        value, slope, curvature = self._function(pose.translation)
        gradient, hessian = np.zeros(6), np.zeros((6, 6))
        gradient[:3], hessian[:3, :3] = slope, curvature
        return Quadratic(value, gradient, hessian)


def _valley(t):
    """Rosenbrock's function with its Gauss-Newton Hessian."""
    residuals = np.array([1.0 - t[0], 10.0 * (t[1] - t[0] ** 2), t[2]])
    jacobian = np.array([[-1.0, 0.0, 0.0], [-20.0 * t[0], 10.0, 0.0], [0.0, 0.0, 1.0]])
    return (
        1.0 + residuals @ residuals,
        2.0 * jacobian.T @ residuals,
        2.0 * jacobian.T @ jacobian,
    )


@_ALL
def test_a_curved_valley_is_followed_to_its_minimum(solver):
    objective = _Translations(_valley)
    solver = type(solver)(
        criteria=ConvergenceCriteria(
            gradient_tolerance=1e-8, step_tolerance=1e-9, max_iterations=400
        )
    )
    solution = solver.minimise(objective, Pose(np.eye(3), np.array([-1.2, 1.0, 0.5])))
    assert solution.reason.is_converged
    np.testing.assert_allclose(solution.pose.translation, [1.0, 1.0, 0.0], atol=1e-6)


@_ALL
def test_accepted_values_fall_to_the_best_pose_evaluated(solver):
    solution = solver.minimise(_d2d(solver.curvature), _FARTHER)
    history = solution.history
    # Of values equal up to rounding, a solver may take either.
    np.testing.assert_allclose(
        solution.quadratic.value, min(entry.value for entry in history), rtol=1e-12
    )
    accepted = [entry for entry in history if entry.accepted]
    values = [entry.value for entry in accepted]
    assert all(late < early for early, late in pairwise(values))
    assert history[0].accepted
    assert (history[0].pose, history[0].step_norm) == (_FARTHER, 0.0)
    assert accepted[-1].pose == solution.pose
    assert accepted[-1].value == solution.quadratic.value


@_ALL
def test_a_start_out_of_range_is_an_empty_objective(solver):
    away = yaw_pose(0.0, (1e3, 0.0, 0.0))
    solution = solver.minimise(_d2d(solver.curvature), away)
    assert solution.reason is StopReason.EMPTY_OBJECTIVE
    assert solution.pose == away
    assert len(solution.history) == 1


@_ALL
@pytest.mark.parametrize("start", [_START, yaw_pose(0.0, (1e3, 0.0, 0.0))], ids=["near", "far"])
def test_a_solution_refers_to_its_objective(solver, start):
    objective = Constraints(dof="xy+yaw").applied_to(_d2d(solver.curvature))
    assert solver.minimise(objective, start).objective is objective


@_ALL
@pytest.mark.parametrize("limit", [1, 2, 3, 5])
def test_evaluations_do_not_exceed_the_maximum(solver, limit):
    solver = type(solver)(criteria=ConvergenceCriteria(max_iterations=limit))
    solution = solver.minimise(_d2d(solver.curvature), _FARTHER)
    assert solution.reason is StopReason.ITERATION_LIMIT
    assert len(solution.history) == limit
    assert solution.quadratic.value == min(entry.value for entry in solution.history)


@_ALL
def test_a_start_at_the_minimum_is_returned(solver):
    minimum = solver.minimise(_d2d(solver.curvature), _START).pose
    solver = type(solver)(criteria=ConvergenceCriteria(gradient_tolerance=1e-4))
    solution = solver.minimise(_d2d(solver.curvature), minimum)
    assert solution.reason is StopReason.GRADIENT_SMALL
    assert solution.pose == minimum
    assert len(solution.history) == 1


@_ALL
@pytest.mark.parametrize("dof", ["xy+yaw", "xyz+yaw"])
def test_locked_directions_do_not_move(solver, dof):
    solution = solver.minimise(Constraints(dof=dof).applied_to(_d2d(solver.curvature)), _START)
    assert solution.reason.is_converged
    np.testing.assert_allclose(solution.pose.rotation[2], [0.0, 0.0, 1.0], atol=1e-12)
    if dof == "xy+yaw":
        np.testing.assert_allclose(solution.pose.translation[2], 0.1, atol=1e-12)


@_ALL
def test_a_direction_without_curvature_does_not_move(solver):
    trough = _Translations(
        lambda t: (1.0 + t[1] ** 2, [0.0, 2.0 * t[1], 0.0], np.diag([0.0, 2.0, 0.0]))
    )
    solution = solver.minimise(trough, yaw_pose(0.0, (2.0, 1.5, 0.0)))
    assert solution.reason.is_converged
    np.testing.assert_allclose(solution.pose.translation, [2.0, 0.0, 0.0], atol=1e-5)


@_ALL
def test_a_slope_without_curvature_is_followed_in_bounded_steps(solver):
    slope = _Translations(lambda t: (1.0 + t[0], [1.0, 0.0, 0.0], np.zeros((3, 3))))
    solver = type(solver)(criteria=ConvergenceCriteria(max_iterations=12))
    solution = solver.minimise(slope, Pose.identity())
    assert solution.reason is StopReason.ITERATION_LIMIT
    assert -12 * 10.5 < solution.pose.translation[0] < -2.0
    assert max(entry.step_norm for entry in solution.history) <= 10.5


@_ALL
def test_poses_without_a_finite_value_are_avoided(solver):
    def parts(t):
        if t[0] > 1.1:
            return np.nan, [np.nan] * 3, np.full((3, 3), np.nan)
        return 1.0 + (t[0] - 1.0) ** 4, [4.0 * (t[0] - 1.0) ** 3, 0.0, 0.0], np.eye(3) * 1e-3

    solution = solver.minimise(_Translations(parts), Pose.identity())
    assert np.isfinite(solution.quadratic.value)
    np.testing.assert_allclose(solution.pose.translation, [1.0, 0.0, 0.0], atol=0.1)


@pytest.mark.parametrize("max_step", [0.1, 1.0])
@pytest.mark.parametrize("solver", [Bfgs, LineSearchNewton])
def test_steps_do_not_exceed_the_maximum(solver, max_step):
    solution = solver(max_step=max_step).minimise(_d2d("exact"), _FARTHER)
    assert solution.reason.is_converged
    # A Newton step may exceed its radius by 1 %, the tolerance of its damping.
    assert max(entry.step_norm for entry in solution.history) <= 1.011 * max_step


def test_damping_falls_after_accepted_steps_and_grows_after_rejected_ones():
    solver = LevenbergMarquardt(first_damping=1e6, criteria=ConvergenceCriteria(max_iterations=4))
    bowl = _Translations(lambda t: (1.0 + t @ t, 2.0 * t, 2.0 * np.eye(3)))
    steps = [
        entry.step_norm
        for entry in solver.minimise(bowl, Pose(np.eye(3), np.array([1.0, 0.0, 0.0]))).history
    ]
    # The mean of the six curvatures is 1, the gradient is 2 and hardly changes.
    np.testing.assert_allclose(steps[1:], [2e-6, 2e-5, 2e-4], rtol=1e-3)
    # A Hessian ten times too small overshoots until the damping makes up for it.
    steep = _Translations(lambda t: (1.0 + 10.0 * t @ t, 20.0 * t, 2.0 * np.eye(3)))
    solver = LevenbergMarquardt(first_damping=0.0)
    history = solver.minimise(steep, Pose(np.eye(3), np.array([1.0, 0.0, 0.0]))).history
    assert [entry.accepted for entry in history[:3]] == [True, False, False]
    assert history[2].step_norm < history[1].step_norm
    assert history[-1].value < 1.0 + 1e-9


@pytest.mark.parametrize(
    ("settings", "match"),
    [
        (lambda: LevenbergMarquardt(growth=1.0), "growth"),
        (lambda: LevenbergMarquardt(decay=0.5), "decay"),
        (lambda: LevenbergMarquardt(first_damping=-1.0), "first_damping"),
        (lambda: LevenbergMarquardt(rotation_scale=0.0), "rotation_scale must be positive"),
        (lambda: LevenbergMarquardt(max_step=0.0), "max_step must be positive"),
        (lambda: Bfgs(first_step=0.0), "first_step must be positive"),
        (lambda: Bfgs(max_step=-1.0), "max_step must be positive"),
        (lambda: LineSearchNewton(rotation_scale=float("nan")), "rotation_scale must be positive"),
        (lambda: LineSearchNewton(max_step=0.0), "max_step must be positive"),
    ],
)
def test_settings_out_of_range_are_rejected(settings, match):
    with pytest.raises(InvalidInput, match=match):
        settings()
