import numpy as np
import pytest

from scanlock.optimisation.solvers.gauss_newton import gauss_newton_step
from scanlock.optimisation.solvers.problem import Quadratic


def _convex(rng, free):
    root = rng.normal(size=(6, 6)) * free
    return root.T @ root


def test_the_step_leads_to_the_minimum():
    rng = np.random.default_rng(0)
    hessian, gradient = _convex(rng, np.ones(6)), rng.normal(size=6)
    step = gauss_newton_step(Quadratic(1.0, gradient, hessian), 20.0)
    np.testing.assert_allclose(hessian @ step, -gradient, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("locked", [[3, 4], [2, 3, 4], [0, 1, 2, 3, 4, 5]])
def test_locked_directions_do_not_move(locked):
    rng = np.random.default_rng(1)
    free = np.ones(6)
    free[locked] = 0.0
    hessian, gradient = _convex(rng, free), rng.normal(size=6) * free
    step = gauss_newton_step(Quadratic(1.0, gradient, hessian), 20.0)
    np.testing.assert_allclose(step[locked], 0.0, atol=1e-12)
    np.testing.assert_allclose(hessian @ step, -gradient, rtol=1e-9, atol=1e-9)


def test_a_direction_without_curvature_does_not_move_along_any_axis():
    rng = np.random.default_rng(2)
    axes = np.linalg.qr(rng.normal(size=(6, 6)))[0]
    hessian = axes @ np.diag([0.0, 1.0, 2.0, 3.0, 4.0, 5.0]) @ axes.T
    gradient = hessian @ rng.normal(size=6) + 1e-12 * axes[:, 0]
    step = gauss_newton_step(Quadratic(1.0, gradient, hessian), 1.0)
    np.testing.assert_allclose(axes[:, 0] @ step, 0.0, atol=1e-9)
