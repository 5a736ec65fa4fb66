import numpy as np
import pytest

from reference import differences
from reference import distribution_pairs as reference
from reference.samples import gaussians
from scanlock.arrays import read_only
from scanlock.geometry.pose import Pose
from scanlock.models.surface_points import SurfacePoints
from scanlock.optimisation.objectives.distribution_pairs import DistributionPairs
from scanlock.optimisation.solvers.bfgs import Bfgs
from scanlock.optimisation.solvers.criteria import ConvergenceCriteria
from scanlock.optimisation.solvers.levenberg_marquardt import LevenbergMarquardt
from scanlock.optimisation.solvers.newton import Newton

_STEPS = np.array([1e-3] * 3 + [1e-4] * 3)


def _surface(some):
    return SurfacePoints(some.means, some.packed_covariances)


def _correspondences(seed, *, exact=True):
    """Correspondences of random Gaussians at one pose, and the same as a list for the reference."""
    rng = np.random.default_rng(seed)
    target, source = gaussians(rng, 40), gaussians(rng, 30)
    correspondences = rng.integers(0, 40, 30)
    correspondences[::7] = -1
    fixed_at = Pose.from_step(rng.normal(0.0, [2.0, 2.0, 1.0, 0.5, 0.5, 1.5]))
    pairs = DistributionPairs.at(
        fixed_at, _surface(target), _surface(source), read_only(correspondences),
        "exact" if exact else "convex",
    )  # fmt: skip
    listed = [
        (target.means[j], target.covariances[j], source.means[i], source.covariances[i])
        for i, j in enumerate(correspondences)
        if j >= 0
    ]
    return pairs, listed, fixed_at, fixed_at.retract(rng.normal(0.0, [1.0] * 3 + [0.3] * 3))


@pytest.mark.parametrize("seed", range(4))
def test_values_match_the_definition(seed):
    pairs, listed, fixed_at, pose = _correspondences(seed)
    assert pairs.count == len(listed) < 30
    for at in (fixed_at, pose):
        np.testing.assert_allclose(
            pairs.linearise(at).value, reference.value(at, fixed_at, listed), rtol=1e-12
        )


def test_the_value_is_half_the_mean_of_the_squared_distances():
    pairs, _, _, pose = _correspondences(4)
    squared = pairs.squared_distances(pose)
    assert squared.shape == (pairs.count,)
    np.testing.assert_allclose(0.5 * squared.mean(), pairs.linearise(pose).value, rtol=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_gradient_and_hessian_match_differences(seed):
    pairs, listed, fixed_at, pose = _correspondences(seed)
    found = pairs.linearise(pose)
    gradient = differences.gradient(lambda at: reference.value(at, fixed_at, listed), pose, _STEPS)
    np.testing.assert_allclose(found.gradient, gradient, rtol=1e-7, atol=1e-7)
    hessian = differences.hessian(lambda at: pairs.linearise(at).gradient, pose, _STEPS)
    scale = np.abs(hessian).max()
    np.testing.assert_allclose(found.hessian, hessian, atol=1e-8 * scale)


@pytest.mark.parametrize("seed", range(4))
def test_the_convex_hessian_is_the_gauss_newton_hessian(seed):
    pairs, listed, fixed_at, pose = _correspondences(seed, exact=False)
    found, exact = pairs.linearise(pose), _correspondences(seed)[0].linearise(pose)
    np.testing.assert_allclose(
        found.hessian, reference.gauss_newton(pose, fixed_at, listed), rtol=1e-10, atol=1e-10
    )
    assert np.linalg.eigvalsh(found.hessian)[0] > 0.0
    np.testing.assert_array_equal(found.gradient, exact.gradient)
    assert found.value == exact.value
    assert np.abs(found.hessian - exact.hessian).max() > 1e-3


def test_a_point_without_a_correspondence_is_left_out():
    rng = np.random.default_rng(5)
    target, source = _surface(gaussians(rng, 20)), _surface(gaussians(rng, 20))
    correspondences = np.arange(20)
    correspondences[7:] = -1
    seven = SurfacePoints(read_only(source.points[:7]), read_only(source.covariances[:7]))
    found, expected = (
        DistributionPairs.at(Pose.identity(), target, one, read_only(rows))
        for one, rows in ((source, correspondences), (seven, correspondences[:7]))
    )
    assert found.count == expected.count == 7
    quadratics = [one.linearise(Pose.identity()) for one in (found, expected)]
    assert quadratics[0].value == quadratics[1].value
    np.testing.assert_array_equal(quadratics[0].hessian, quadratics[1].hessian)


def test_covariances_do_not_rotate_with_the_pose():
    # Two thin planes: rotated covariances would sum to a thicker one.
    plane = read_only(np.array([[1.0, 0.0, 0.0, 1.0, 0.0, 1e-3]]))
    one = SurfacePoints(read_only(np.array([[5.0, 0.0, 0.0]])), plane)
    other = SurfacePoints(read_only(np.array([[5.0, 0.0, 0.1]])), plane)
    pairs = DistributionPairs.at(Pose.identity(), one, other, read_only(np.zeros(1, np.int64)))
    about_the_point = Pose.from_step(np.array([0.0, 0.0, 0.0, 0.3, 0.0, 0.0]))
    lifted = np.cos(0.3) * 0.1
    expected = 0.5 * (lifted**2 / 2e-3 + (np.sin(0.3) * 0.1) ** 2 / 2.0)
    np.testing.assert_allclose(pairs.linearise(about_the_point).value, expected, rtol=1e-12)


@pytest.mark.parametrize("solver", [Newton, LevenbergMarquardt, Bfgs])
def test_every_solver_minimises_it(solver):
    rng = np.random.default_rng(6)
    truth = Pose.from_step(rng.normal(0.0, [1.0, 1.0, 0.3, 0.1, 0.1, 0.4]))
    target = gaussians(rng, 200)
    source = target.transformed(truth.inverse())
    settings = solver(criteria=ConvergenceCriteria(max_iterations=200))
    pairs = DistributionPairs.at(
        Pose.identity(), _surface(target), _surface(source), read_only(np.arange(200)),
        settings.curvature,
    )  # fmt: skip
    solution = settings.minimise(pairs, Pose.identity())
    assert solution.reason.is_converged
    assert solution.pose.is_close(truth, translation=1e-4, rotation=1e-5)
