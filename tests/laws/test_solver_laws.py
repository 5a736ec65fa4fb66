"""Interchangeable solvers end at the same minimum."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reference.samples import gaussians
from scanlock.arrays import read_only
from scanlock.geometry.pose import Pose
from scanlock.optimisation.objectives.gaussian_scores import GaussiansToGaussians, PointsToGaussians
from scanlock.optimisation.solvers.bfgs import Bfgs
from scanlock.optimisation.solvers.levenberg_marquardt import LevenbergMarquardt
from scanlock.optimisation.solvers.line_search import Armijo
from scanlock.optimisation.solvers.line_search_newton import LineSearchNewton
from scanlock.optimisation.solvers.more_thuente import MoreThuente
from scanlock.optimisation.solvers.newton import Newton

pytestmark = pytest.mark.slow

_SOLVERS = [
    LineSearchNewton(),
    LineSearchNewton(line_search=Armijo()),
    LevenbergMarquardt(),
    LevenbergMarquardt(first_damping=0.0),
    Bfgs(),
    Bfgs(line_search=Armijo()),
    Bfgs(line_search=MoreThuente()),
]


def _d2d(rng, target, curvature):
    motion = Pose.from_step(rng.normal(0.0, [0.1] * 3 + [0.01] * 3))
    return GaussiansToGaussians(
        target=target, source=target.transformed(motion), curvature=curvature
    )


def _p2d(rng, target, curvature):
    draws = [
        rng.multivariate_normal(mean, covariance, 15)
        for mean, covariance in zip(target.means, target.covariances, strict=True)
    ]
    return PointsToGaussians(
        target=target, points=read_only(np.concatenate(draws)), curvature=curvature
    )


@pytest.mark.parametrize("make", [_d2d, _p2d])
@settings(max_examples=12)
@given(seed=st.integers(0, 2**32 - 1), solver=st.sampled_from(_SOLVERS))
def test_from_a_near_start_every_solver_ends_at_the_minimum_of_newton(make, seed, solver):
    rng = np.random.default_rng(seed)
    target = gaussians(rng, 50)
    start = Pose.from_step(rng.normal(0.0, [0.1] * 3 + [0.01] * 3))
    drawn = rng.bit_generator.state
    solutions = []
    for one in (Newton(), solver):
        rng.bit_generator.state = drawn
        solutions.append(one.minimise(make(rng, target, one.curvature), start))
    newton, other = solutions
    assert newton.reason.is_converged
    assert other.reason.is_converged
    assert other.pose.is_close(newton.pose, translation=1e-5, rotation=1e-6)
    np.testing.assert_allclose(other.quadratic.value, newton.quadratic.value, rtol=1e-9)
