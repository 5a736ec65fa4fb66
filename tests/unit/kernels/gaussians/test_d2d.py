from itertools import pairwise

import numpy as np
import pytest

from reference import gaussian_scores as reference
from reference.samples import gaussians
from scanlock.arrays import read_only
from scanlock.geometry.pose import Pose
from scanlock.kernels.gaussians.d2d import d2d_terms
from scanlock.models.gaussians import Gaussians
from scanlock.optimisation.solvers.problem import Quadratic


def _terms(
    target,
    source,
    pose,
    *,
    sharpness=1.0,
    start=16.0,
    end=25.0,
    exact=1.0,
    lists=None,
):
    def gaussian_arrays(cluster_set):
        return cluster_set.means, cluster_set.packed_covariances, cluster_set.weights()

    all_pairs = (
        np.zeros(len(source), np.int64),
        np.array([0, len(target)]),
        np.arange(len(target)),
    )
    return d2d_terms(
        *gaussian_arrays(target),
        *gaussian_arrays(source),
        *(lists or (read_only(array) for array in all_pairs)),
        pose.rotation,
        pose.translation,
        sharpness,
        start,
        end,
        exact,
    )


def _isotropic(mean, variance):
    return Gaussians.from_covariances(np.array([mean]), variance * np.eye(3)[None], np.array([1]))


@pytest.mark.parametrize("sharpness", [1.0, 0.3])
@pytest.mark.parametrize("seed", range(6))
def test_the_value_is_the_sum_over_all_pairs(seed, sharpness):
    rng = np.random.default_rng(seed)
    target, source = gaussians(rng, 60), gaussians(rng, 50)
    pose = Pose.from_step(rng.normal(0.0, [3.0, 3.0, 1.0, 1.0, 1.0, 2.0]))
    value = _terms(target, source, pose, sharpness=sharpness)[0]
    # The kernel takes the window in squared distance, the definition in sharpness times it.
    expected = reference.d2d_value(
        pose, target, source, sharpness=sharpness, start=16.0 * sharpness, end=25.0 * sharpness
    )
    assert expected < 0.0
    np.testing.assert_allclose(value, expected, rtol=1e-12)


@pytest.mark.parametrize("edge", [16.0, 25.0])
def test_the_window_is_twice_continuously_differentiable(edge):
    # Along x a pair of unit covariances has s = x^2 / 2, so its first Hessian entry is the
    # second derivative of the score. Its slope is bounded, so its change over a small step is
    # proportional to the step.
    def second(s):
        pose = Pose(np.eye(3), np.array([np.sqrt(2.0 * s), 0.0, 0.0]))
        terms = _terms(
            _isotropic([0.0, 0.0, 0.0], 1.0), _isotropic([0.0, 0.0, 0.0], 1.0), pose, sharpness=0.1
        )
        return terms[[0, 1, 7]]

    differences = [np.abs(second(edge + step) - second(edge - step)) for step in (1e-3, 1e-4, 1e-5)]
    assert (differences[0] < 1e-2).all()
    for wide, narrow in pairwise(differences):
        assert (narrow <= 0.11 * wide + 1e-15).all()
    if edge == 25.0:
        np.testing.assert_array_equal(second(edge + 1e-9), 0.0)
    else:
        assert (np.abs(second(edge)) > 1e-3).all()


def test_all_terms_are_zero_beyond_the_window():
    pose = Pose(np.eye(3), np.array([8.0, 0.0, 0.0]))
    terms = _terms(_isotropic([0.0, 0.0, 0.0], 1.0), _isotropic([0.0, 0.0, 0.0], 1.0), pose)
    np.testing.assert_array_equal(terms, np.zeros(28))


def test_empty_sets_have_zero_terms():
    rng = np.random.default_rng(6)
    some, none = gaussians(rng, 5), gaussians(rng, 0)
    for pair in ((some, none), (none, some), (none, none)):
        np.testing.assert_array_equal(_terms(*pair, Pose.identity()), np.zeros(28))


def test_results_are_bitwise_reproducible():
    rng = np.random.default_rng(7)
    target, source = gaussians(rng, 30), gaussians(rng, 30)
    pose = Pose.from_step(rng.normal(size=6))
    assert len({_terms(target, source, pose).tobytes() for _ in range(5)}) == 1


def test_the_convex_hessian_is_positive_semidefinite_with_the_same_gradient():
    rng = np.random.default_rng(8)
    target, source = gaussians(rng, 40), gaussians(rng, 40)
    indefinite = 0
    for _ in range(20):
        pose = Pose.from_step(rng.normal(0.0, 2.0, 6))
        exact, convex = (_terms(target, source, pose, exact=exact) for exact in (1.0, 0.0))
        np.testing.assert_array_equal(convex[:7], exact[:7])
        eigenvalues = np.linalg.eigvalsh(Quadratic.from_terms(convex).hessian)
        assert eigenvalues[0] >= -1e-12 * eigenvalues[-1]
        indefinite += np.linalg.eigvalsh(Quadratic.from_terms(exact).hessian)[0] < 0.0
    assert indefinite > 0


def test_the_convex_and_exact_hessians_are_equal_at_a_perfect_fit():
    # With q = 0 all terms that the convex Hessian omits are zero.
    one = _isotropic([3.0, 1.0, 2.0], 1.0)
    exact, convex = (_terms(one, one, Pose.identity(), exact=exact) for exact in (1.0, 0.0))
    np.testing.assert_allclose(convex, exact, atol=1e-12)
    assert np.abs(convex[7:]).max() > 0.1


def _lists(lists, starts, members):
    return tuple(read_only(np.array(array)) for array in (lists, starts, members))


def test_lists_select_the_pairs():
    # The first source has targets 4 and 1, the second none, the third target 2.
    rng = np.random.default_rng(10)
    target, source = gaussians(rng, 6, half_width=2.0), gaussians(rng, 3, half_width=2.0)
    pose = Pose.from_step(0.1 * rng.normal(size=6))
    found = _terms(target, source, pose, lists=_lists([1, -1, 0], [0, 1, 3], [2, 4, 1]))[0]
    s = reference.d2d_squared(
        pose, target.means, target.covariances, source.means, source.covariances
    )
    scores = source.weights()[:, None] * target.weights() * reference.rho(s)
    expected = -(scores[0, 4] + scores[0, 1] + scores[2, 2])
    assert expected < 0.0
    np.testing.assert_allclose(found, expected, rtol=1e-12)
