import numpy as np
import pytest

from reference import jackknife as reference
from scanlock.registration.uncertainty.sandwich import (
    BlockTerms,
    jackknife,
    root_of,
    sandwich,
    steps_without,
    tilted,
)


def _regression(seed, count=240, size=4, units=30):
    """A linear fit whose residuals share a part within each unit."""
    rng = np.random.default_rng(seed)
    member = np.arange(count) % units
    jacobians = rng.normal(size=(count, size)) + 0.5 * rng.normal(size=(units, size))[member]
    shared = rng.normal(size=units)[member]
    residuals = rng.normal(size=count) + shared
    weights = rng.uniform(0.5, 2.0, count)
    step = reference.minimum(jacobians, residuals, weights)
    return jacobians, residuals + jacobians @ step, weights, member


def _shares(jacobians, residuals, weights, units):
    gradients = (weights * residuals)[:, None] * jacobians
    hessians = weights[:, None, None] * jacobians[:, :, None] * jacobians[:, None, :]
    return BlockTerms(gradients, hessians, (units,))


def _widened(shares, root):
    """What the sandwich allows for few units, from the definition of their effective number."""
    (labels,) = shares.grids
    weights = np.zeros(labels.max() + 1)
    np.add.at(weights, labels, np.einsum("ab,nbc,ca->n", root.T, shares.hessians, root))
    return 1.0 + (len(root) + 1.0) * float(np.sum((weights / len(root)) ** 2))


@pytest.mark.parametrize("seed", range(3))
def test_the_sandwich_is_the_jackknife_of_a_linear_fit(seed):
    fit = _regression(seed)
    shares = _shares(*fit)
    root = root_of(shares.hessians.sum(axis=0), np.ones(4))
    assert root is not None
    found, units = sandwich(shares, root)
    expected = reference.covariance(*fit)
    np.testing.assert_allclose(
        root @ found @ root.T, _widened(shares, root) * expected, rtol=1e-9, atol=1e-12
    )
    assert 10.0 < units <= 30.0


def test_it_whitens():
    rng = np.random.default_rng(4)
    half = rng.normal(size=(6, 20))
    hessian = half @ half.T
    root = root_of(hessian, np.array([1.0, 1.0, 1.0, 20.0, 20.0, 20.0]))
    assert root is not None
    np.testing.assert_allclose(root.T @ hessian @ root, np.eye(6), atol=1e-10)


@pytest.mark.parametrize("least", [0.0, -1e-3])
def test_an_open_direction_has_no_root(least):
    assert root_of(np.diag([1.0, 2.0, least]), np.ones(3)) is None


def test_the_foretold_covariance_is_that_of_the_estimates():
    rng_seeds = range(400)
    size, told, found = 3, np.zeros((3, 3)), []
    for seed in rng_seeds:
        rng = np.random.default_rng([seed, 1])
        units = np.arange(200) % 40
        jacobians = np.random.default_rng(0).normal(size=(200, size))
        residuals = rng.normal(size=200) + 2.0 * rng.normal(size=40)[units]
        step = reference.minimum(jacobians, residuals, np.ones(200))
        shares = _shares(jacobians, residuals + jacobians @ step, np.ones(200), units)
        root = root_of(shares.hessians.sum(axis=0), np.ones(size))
        assert root is not None
        told += root @ sandwich(shares, root)[0] @ root.T / len(rng_seeds)
        found.append(step)
    # Squared errors over what was foretold have a mean of the number of directions.
    nees = np.mean([step @ np.linalg.solve(told, step) for step in found])
    assert 0.75 * size < nees < 1.1 * size


def test_one_unit_that_holds_all_is_capped():
    hessians = np.array([np.diag([1.0, 0.3]), np.diag([0.0, 0.7])])
    gradients = np.array([[0.1, 0.2], [-0.1, -0.2]])
    np.testing.assert_allclose(
        steps_without(gradients, hessians), [[1.0, 0.2 / 0.7], [-0.1, -0.2 / 0.3]], rtol=1e-12
    )


def test_a_jackknife_of_equal_steps_is_zero():
    assert not jackknife(np.tile([1.0, -2.0], (7, 1))).any()


def test_what_hangs_on_a_tilt_grows_with_it():
    rng = np.random.default_rng(6)
    half = rng.normal(size=(4, 9))
    covariance, rows = half @ half.T, np.array([1, 2])
    found = tilted(covariance, rows, 2.0)
    np.testing.assert_allclose(found[1:3], 4.0 * covariance[1:3], rtol=1e-12)
    # Given the tilt, the rest is as sure as before: that block of the inverse is the same.
    rest = np.ix_([0, 3], [0, 3])
    np.testing.assert_allclose(np.linalg.inv(found)[rest], np.linalg.inv(covariance)[rest])
    np.testing.assert_array_equal(tilted(covariance, np.array([], np.int64), 2.0), covariance)
