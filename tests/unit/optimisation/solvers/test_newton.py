import numpy as np
import pytest

from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import hat
from scanlock.optimisation.solvers.criteria import ConvergenceCriteria, StopReason
from scanlock.optimisation.solvers.newton import Newton
from scanlock.optimisation.solvers.problem import Quadratic

_OFFSET = -1.0
"""Added to all values below: a solver takes a zero quadratic for an empty objective."""


class _Function:
    """A function of the translation alone, with its gradient and Hessian."""

    def __init__(self, value, gradient, hessian):
        self._parts = value, gradient, hessian
        self.calls = 0

    def linearise(self, pose):
        self.calls += 1
        value, gradient, hessian = (part(pose.translation) for part in self._parts)
        full = np.zeros((6, 6))
        full[:3, :3] = hessian
        return Quadratic(_OFFSET + value, np.append(np.asarray(gradient, float), np.zeros(3)), full)


class _PointPairs:
    """Half the sum of squared distances of correspondences, with exact derivatives."""

    def __init__(self, target, source):
        self.target, self.source = target, source

    def linearise(self, pose):
        moved = pose.apply(self.source)
        residuals = moved - self.target
        gradient, hessian, convex = np.zeros(6), np.zeros((6, 6)), np.zeros((6, 6))
        for y, r in zip(moved, residuals, strict=True):
            jacobian = np.hstack([np.eye(3), -hat(y)])
            gradient += jacobian.T @ r
            convex += jacobian.T @ jacobian
            hessian[3:, 3:] += 0.5 * (np.outer(r, y) + np.outer(y, r)) - (r @ y) * np.eye(3)
        return Quadratic(_OFFSET + 0.5 * (residuals**2).sum(), gradient, convex + hessian)


def _bowl(minimum, curvatures=(1.0, 1.0, 1.0)):
    curvatures = np.array(curvatures)
    return _Function(
        lambda t: 0.5 * curvatures @ (t - minimum) ** 2,
        lambda t: curvatures * (t - minimum),
        lambda t: np.diag(curvatures),
    )


def _rosenbrock():
    return _Function(
        lambda t: (1 - t[0]) ** 2 + 100 * (t[1] - t[0] ** 2) ** 2 + t[2] ** 2,
        lambda t: [
            -2 * (1 - t[0]) - 400 * t[0] * (t[1] - t[0] ** 2),
            200 * (t[1] - t[0] ** 2),
            2 * t[2],
        ],
        lambda t: np.array(
            [
                [2 - 400 * (t[1] - 3 * t[0] ** 2), -400 * t[0], 0.0],
                [-400 * t[0], 200.0, 0.0],
                [0.0, 0.0, 2.0],
            ]
        ),
    )


def _double_well():
    """x^2 + (y^2 - 1)^2 + z^2: a saddle at zero between minima at y = -1 and y = 1."""
    return _Function(
        lambda t: t[0] ** 2 + (t[1] ** 2 - 1) ** 2 + t[2] ** 2,
        lambda t: [2 * t[0], 4 * t[1] * (t[1] ** 2 - 1), 2 * t[2]],
        lambda t: np.diag([2.0, 12 * t[1] ** 2 - 4, 2.0]),
    )


def _gaussian_well():
    """Minus a Gaussian of width one: its Hessian is indefinite beyond that width."""
    return _Function(
        lambda t: -1e3 * np.exp(-0.5 * t @ t),
        lambda t: 1e3 * np.exp(-0.5 * t @ t) * t,
        lambda t: 1e3 * np.exp(-0.5 * t @ t) * (np.eye(3) - np.outer(t, t)),
    )


def _at(*translation):
    return Pose(np.eye(3), np.array(translation, float))


def _assert_consistent(solution, solver):
    """Accepted values fall, and the last accepted pose is the result."""
    history = solution.history
    accepted = [entry for entry in history if entry.accepted]
    values = [entry.value for entry in accepted]
    assert history[0].accepted
    assert history[0].step_norm == 0.0
    assert values == sorted(values, reverse=True)
    assert len(set(values)) == len(values)
    last_step, _ = solution.pose.distance(accepted[-1].pose)
    if solution.reason is StopReason.STEP_SMALL:
        assert last_step < solver.criteria.step_tolerance
        assert solution.quadratic.value <= values[-1]
    else:
        assert last_step == 0.0
        assert solution.quadratic.value == values[-1]
    assert len(history) <= solver.criteria.max_iterations
    # A step may exceed the radius by 1 %, the tolerance of the search for the damping.
    steps = [entry.step_norm for entry in history]
    assert max(steps) <= 1.01 * max(solver.first_radius, solver.max_radius)
    if len(steps) > 1:
        assert steps[1] <= 1.01 * solver.first_radius


@pytest.mark.parametrize("curvatures", [(1.0, 1.0, 1.0), (1e2, 1.0, 5.0), (3e-3, 1.0, 1.0)])
def test_a_quadratic_within_the_radius_takes_one_step(curvatures):
    solver = Newton()
    solution = solver.minimise(_bowl(np.array([1.0, -2.0, 3.0]), curvatures), Pose.identity())
    np.testing.assert_allclose(solution.pose.translation, [1.0, -2.0, 3.0], atol=1e-9)
    assert len(solution.history) == 2
    assert solution.reason is StopReason.GRADIENT_SMALL
    _assert_consistent(solution, solver)


def test_a_last_step_below_the_tolerance_is_taken_as_predicted():
    minimum = np.array([1.0, -2.0, 3.0])
    bowl, start = _bowl(minimum), _at(1.004, -2.0, 3.003)
    solution = Newton(criteria=ConvergenceCriteria(step_tolerance=0.01)).minimise(bowl, start)
    assert bowl.calls == 1
    assert solution.reason is StopReason.STEP_SMALL
    np.testing.assert_allclose(solution.pose.translation, minimum, atol=1e-12)
    there = bowl.linearise(solution.pose)
    np.testing.assert_allclose(solution.quadratic.value, there.value, rtol=1e-12)
    np.testing.assert_allclose(solution.quadratic.gradient, there.gradient, atol=1e-12)
    np.testing.assert_array_equal(solution.quadratic.hessian, there.hessian)


def test_a_small_step_limited_by_the_radius_is_not_taken():
    # Every value is worse than the first, so the radius shrinks until steps are small.
    class _Worse:
        def __init__(self):
            self.calls = 0

        def linearise(self, pose):
            self.calls += 1
            gradient = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
            return Quadratic(_OFFSET + (self.calls > 1), gradient, np.eye(6))

    solution = Newton(criteria=ConvergenceCriteria(step_tolerance=1e-3)).minimise(
        _Worse(), Pose.identity()
    )
    assert solution.reason is StopReason.STEP_SMALL
    assert solution.pose == Pose.identity()


def test_steps_do_not_exceed_the_trust_radius():
    solver = Newton(first_radius=0.5, max_radius=3.0)
    solution = solver.minimise(_bowl(np.array([20.0, 0.0, 0.0])), Pose.identity())
    steps = np.array([entry.step_norm for entry in solution.history])
    # The quadratic is exact, so the radius doubles up to its maximum.
    np.testing.assert_allclose(steps[1:5], [0.5, 1.0, 2.0, 3.0], rtol=0.02)
    np.testing.assert_allclose(solution.pose.translation, [20.0, 0.0, 0.0], atol=1e-6)
    _assert_consistent(solution, solver)


def test_a_first_radius_above_the_maximum_is_rejected():
    with pytest.raises(InvalidInput, match=r"max_radius must be at least 20\.0 m, got 10\.0 m"):
        Newton(first_radius=20.0, max_radius=10.0)


def test_rosenbrocks_valley_is_followed_to_its_minimum():
    # At the minimum the curvatures differ by a factor of 2500, more than the solver allows. The
    # last steps are too short by a factor, and a step of 1e-9 leaves an error of that size.
    solver = Newton(criteria=ConvergenceCriteria(gradient_tolerance=1e-9, step_tolerance=1e-9))
    solution = solver.minimise(_rosenbrock(), _at(-1.2, 1.0, 1.0))
    np.testing.assert_allclose(solution.pose.translation, [1.0, 1.0, 0.0], atol=1e-8)
    assert solution.reason.is_converged
    _assert_consistent(solution, solver)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_start_beside_a_saddle_ends_on_its_own_side(side):
    solver = Newton()
    solution = solver.minimise(_double_well(), _at(0.5, 1e-3 * side, -0.5))
    np.testing.assert_allclose(solution.pose.translation, [0.0, side, 0.0], atol=1e-6)
    _assert_consistent(solution, solver)


def test_an_indefinite_hessian_at_the_start_gives_a_descent_direction():
    solver = Newton()
    solution = solver.minimise(_gaussian_well(), _at(2.0, -1.5, 1.0))
    np.testing.assert_allclose(solution.pose.translation, np.zeros(3), atol=1e-6)
    assert np.linalg.eigvalsh(solution.quadratic.hessian)[-1] > 0
    _assert_consistent(solution, solver)


def test_the_top_of_a_hill_is_left_downhill():
    hill = _Function(lambda t: -(t @ t), lambda t: -2.0 * t, lambda t: -2.0 * np.eye(3))
    solver = Newton(criteria=ConvergenceCriteria(max_iterations=6))
    solution = solver.minimise(hill, _at(1e-3, 0.0, 0.0))
    assert solution.reason is StopReason.ITERATION_LIMIT
    # Each step is as long as the distance from the top, which doubles.
    np.testing.assert_allclose(solution.pose.translation, [1e-3 * 2**5, 0.0, 0.0])
    _assert_consistent(solution, solver)


def test_a_flat_function_stops_at_the_start():
    flat = _Function(lambda t: 0.0, lambda t: np.zeros(3), lambda t: np.zeros((3, 3)))
    start = _at(1.0, 2.0, 3.0)
    solution = Newton().minimise(flat, start)
    assert solution.reason is StopReason.GRADIENT_SMALL
    assert solution.pose == start
    assert len(solution.history) == flat.calls == 1


def test_a_slope_without_curvature_is_followed_at_the_trust_radius():
    slope = _Function(lambda t: t[0], lambda t: [1.0, 0.0, 0.0], lambda t: np.zeros((3, 3)))
    solver = Newton(criteria=ConvergenceCriteria(max_iterations=4))
    solution = solver.minimise(slope, Pose.identity())
    assert solution.reason is StopReason.ITERATION_LIMIT
    np.testing.assert_allclose(solution.pose.translation, [-25.0, 0.0, 0.0], rtol=0.03)


def test_a_zero_quadratic_is_an_empty_objective():
    class Nothing:
        def linearise(self, pose):
            return Quadratic(0.0, np.zeros(6), np.zeros((6, 6)))

    start = _at(1.0, 2.0, 3.0)
    solution = Newton().minimise(Nothing(), start)
    assert solution.reason is StopReason.EMPTY_OBJECTIVE
    assert solution.pose == start
    assert len(solution.history) == 1


@pytest.mark.parametrize("limit", [1, 2, 5, 11])
def test_evaluations_do_not_exceed_the_maximum(limit):
    function = _rosenbrock()
    solver = Newton(criteria=ConvergenceCriteria(max_iterations=limit))
    solution = solver.minimise(function, _at(-1.2, 1.0, 0.0))
    assert solution.reason is StopReason.ITERATION_LIMIT
    assert function.calls == len(solution.history) == limit
    _assert_consistent(solution, solver)


def test_the_best_pose_is_returned_at_the_iteration_limit():
    solver = Newton(criteria=ConvergenceCriteria(max_iterations=8))
    solution = solver.minimise(_rosenbrock(), _at(-1.2, 1.0, 0.0))
    assert any(not entry.accepted for entry in solution.history)
    assert solution.quadratic.value == min(entry.value for entry in solution.history)


def test_both_tolerances_stop_the_solver():
    loose, tight = (
        Newton(
            criteria=ConvergenceCriteria(gradient_tolerance=gradient, step_tolerance=1e-12)
        ).minimise(_rosenbrock(), _at(-1.2, 1.0, 0.0))
        for gradient in (1e-2, 1e-8)
    )
    assert loose.reason is tight.reason is StopReason.GRADIENT_SMALL
    assert loose.history[-1].gradient_norm < 1e-2 <= loose.history[-2].gradient_norm
    assert tight.history[-1].gradient_norm < 1e-8
    assert len(loose.history) < len(tight.history)

    stepped = Newton(
        criteria=ConvergenceCriteria(gradient_tolerance=1e-30, step_tolerance=0.5)
    ).minimise(_bowl(np.array([0.3, 0.0, 0.0])), Pose.identity())
    assert stepped.reason is StopReason.STEP_SMALL
    assert len(stepped.history) == 1


def test_rotations_count_at_the_rotation_scale():
    rng = np.random.default_rng(0)
    source = rng.normal(size=(30, 3))
    turn = Pose.from_step(np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0]))
    solver = Newton(rotation_scale=10.0, first_radius=2.0, max_radius=2.0)
    solution = solver.minimise(_PointPairs(turn.apply(source), source), Pose.identity())
    first = solution.history[1]
    metres, radians = first.pose.distance(Pose.identity())
    np.testing.assert_allclose(np.hypot(metres, 10.0 * radians), first.step_norm, rtol=1e-2)
    assert first.step_norm <= 2.02
    assert solution.pose.is_close(turn, translation=1e-6, rotation=1e-6)


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.5, 2.8])
@pytest.mark.parametrize("offset", [0.0, 20.0])
def test_correspondences_are_aligned(angle, offset):
    # The sum of squares over rotations has a single minimum.
    rng = np.random.default_rng(1)
    source = rng.normal(0.0, 10.0, (25, 3)) + offset
    axis = np.array([1.0, -2.0, 3.0]) / np.sqrt(14.0)
    motion = Pose.from_step(np.concatenate([[5.0, -3.0, 1.0], angle * axis]))
    around = Pose(np.eye(3), np.full(3, offset))
    motion = around @ motion @ around.inverse()
    solver = Newton(criteria=ConvergenceCriteria(gradient_tolerance=1e-4, step_tolerance=1e-9))
    solution = solver.minimise(_PointPairs(motion.apply(source), source), Pose.identity())
    assert solution.reason.is_converged
    np.testing.assert_allclose(solution.pose.apply(source), motion.apply(source), atol=1e-5)
    _assert_consistent(solution, solver)


def test_a_start_at_the_minimum_is_returned():
    start = _at(1.0, -2.0, 3.0)
    solution = Newton().minimise(_bowl(start.translation), start)
    assert solution.pose == start
    assert solution.reason is StopReason.GRADIENT_SMALL
    assert len(solution.history) == 1


@pytest.mark.parametrize("name", ["rotation_scale", "first_radius", "max_radius"])
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
def test_settings_out_of_range_are_rejected_by_name(name, value):
    with pytest.raises(InvalidInput, match=f"{name} must be positive"):
        Newton(**{name: value})
