import numpy as np
import pytest

from scanlock.geometry.pose import Pose
from scanlock.optimisation.solvers.criteria import ConvergenceCriteria, StopReason
from scanlock.optimisation.solvers.newton import Newton
from scanlock.optimisation.solvers.problem import Quadratic
from scanlock.optimisation.solvers.staged import minimise_staged, stage_tolerances, staged_solvers


class _Bowl:
    """Half the squared distance of the translation from a point, less 1."""

    count = 1

    def __init__(self, minimum):
        self._minimum = np.array(minimum, float)

    def linearise(self, pose):
        residual = pose.translation - self._minimum
        hessian = np.zeros((6, 6))
        hessian[:3, :3] = np.eye(3)
        return Quadratic(
            -1.0 + 0.5 * residual @ residual, np.append(residual, np.zeros(3)), hessian
        )


class _Empty:
    count = 1

    def linearise(self, pose):
        return Quadratic(0.0, np.zeros(6), np.zeros((6, 6)))


def test_each_stage_begins_at_the_pose_of_the_last_one():
    minima = ([1.0, 0.0, 0.0], [1.0, 2.0, 0.0])
    bowls = [_Bowl(minimum) for minimum in minima]
    found = minimise_staged(Newton(), bowls, [0.0, 0.0], Pose.identity())
    np.testing.assert_allclose(found.pose.translation, minima[1], atol=1e-6)
    visited = [entry.pose.translation.tolist() for entry in found.history]
    assert visited[0] == [0.0, 0.0, 0.0]
    begins = [k for k, entry in enumerate(found.history) if entry.step_norm == 0.0]
    assert len(begins) == 2
    np.testing.assert_allclose(visited[begins[1]], minima[0], atol=1e-6)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_an_empty_stage_is_passed_over(order):
    objectives = [_Bowl([1.0, 0.0, 0.0]), _Empty()]
    ordered = [objectives[k] for k in order]
    found = minimise_staged(Newton(), ordered, [0.0, 0.0], Pose.identity())
    assert found.objective is objectives[0]
    assert found.reason.is_converged
    np.testing.assert_allclose(found.pose.translation, [1.0, 0.0, 0.0], atol=1e-6)


def test_the_start_is_returned_unchanged_where_all_stages_are_empty():
    start = Pose.from_step(np.arange(6.0))
    found = minimise_staged(Newton(), [_Empty()] * 2, [0.0, 0.0], start)
    assert found.reason is StopReason.EMPTY_OBJECTIVE
    assert found.pose == start
    assert len(found.history) == 2


def test_coarse_tolerances_do_not_go_below_that_of_the_last_stage():
    assert stage_tolerances(1e-3, [0.1, 1e-6, 0.1]) == [0.1, 1e-3, 1e-3]
    assert stage_tolerances(1e-3, [0.1]) == [1e-3]


def test_the_last_stage_has_the_tolerance_of_the_solver():
    solver = Newton(criteria=ConvergenceCriteria(step_tolerance=1e-3, max_iterations=7))
    first, second, last = staged_solvers(solver, [0.1, 1e-6, 0.1])
    assert first.criteria == ConvergenceCriteria(step_tolerance=0.1, max_iterations=7)
    assert second == solver
    assert last == solver
    assert staged_solvers(solver, [0.1]) == [solver]
