import numpy as np
import pytest

from reference import jackknife as reference
from scanlock.registration.uncertainty.sandwich import (
    BlockTerms,
    inflated,
    jackknife_covariance,
    leave_one_out_steps,
    sandwich_covariance,
    whitening_matrix,
)


def _regression(seed, count=240, size=4, blocks=30):
    """A linear fit at its minimum, with residuals that are correlated within each block."""
    rng = np.random.default_rng(seed)
    labels = np.arange(count) % blocks
    jacobians = rng.normal(size=(count, size)) + 0.5 * rng.normal(size=(blocks, size))[labels]
    residuals = rng.normal(size=blocks)[labels] + rng.normal(size=count)
    weights = rng.uniform(0.5, 2.0, count)
    step = reference.minimum(jacobians, residuals, weights)
    return jacobians, residuals + jacobians @ step, weights, labels


def _terms(jacobians, residuals, weights, labels):
    gradients = (weights * residuals)[:, None] * jacobians
    hessians = weights[:, None, None] * jacobians[:, :, None] * jacobians[:, None, :]
    return BlockTerms(gradients=gradients, hessians=hessians, grids=(labels,))


def _inflation(terms, whitening):
    """The inflation for few blocks, from the definition of their effective number."""
    (labels,) = terms.grids
    leverages = np.einsum("ab,nbc,ca->n", whitening.T, terms.hessians, whitening)
    weights = np.bincount(labels, leverages)
    return 1.0 + (len(whitening) + 1.0) * float(np.sum((weights / len(whitening)) ** 2))


@pytest.mark.parametrize("seed", range(3))
def test_the_sandwich_is_the_jackknife_of_a_linear_fit(seed):
    fit = _regression(seed)
    terms = _terms(*fit)
    whitening = whitening_matrix(terms.hessians.sum(axis=0), np.ones(4))
    assert whitening is not None
    found, blocks = sandwich_covariance(terms, whitening)
    expected = _inflation(terms, whitening) * reference.covariance(*fit)
    np.testing.assert_allclose(whitening @ found @ whitening.T, expected, rtol=1e-9, atol=1e-12)
    assert 10.0 < blocks <= 30.0


def test_the_whitening_matrix_whitens_the_hessian():
    rng = np.random.default_rng(4)
    half = rng.normal(size=(6, 20))
    hessian = half @ half.T
    whitening = whitening_matrix(hessian, np.array([1.0, 1.0, 1.0, 20.0, 20.0, 20.0]))
    assert whitening is not None
    np.testing.assert_allclose(whitening.T @ hessian @ whitening, np.eye(6), atol=1e-10)


@pytest.mark.parametrize("smallest", [0.0, -1e-3])
def test_a_singular_hessian_has_no_whitening_matrix(smallest):
    assert whitening_matrix(np.diag([1.0, 2.0, smallest]), np.ones(3)) is None


def test_the_estimated_covariance_is_that_of_the_estimates():
    seeds = range(400)
    size, estimated, errors = 3, np.zeros((3, 3)), []
    for seed in seeds:
        rng = np.random.default_rng([seed, 1])
        labels = np.arange(200) % 40
        jacobians = np.random.default_rng(0).normal(size=(200, size))
        residuals = rng.normal(size=200) + 2.0 * rng.normal(size=40)[labels]
        step = reference.minimum(jacobians, residuals, np.ones(200))
        terms = _terms(jacobians, residuals + jacobians @ step, np.ones(200), labels)
        whitening = whitening_matrix(terms.hessians.sum(axis=0), np.ones(size))
        assert whitening is not None
        covariance = whitening @ sandwich_covariance(terms, whitening)[0] @ whitening.T
        estimated += covariance / len(seeds)
        errors.append(step)
    # The mean NEES of calibrated estimates is the number of directions.
    nees = np.mean([error @ np.linalg.solve(estimated, error) for error in errors])
    assert 0.75 * size < nees < 1.1 * size


def test_the_leverage_of_a_dominant_block_is_capped():
    hessians = np.array([np.diag([1.0, 0.3]), np.diag([0.0, 0.7])])
    gradients = np.array([[0.1, 0.2], [-0.1, -0.2]])
    np.testing.assert_allclose(
        leave_one_out_steps(gradients, hessians),
        [[1.0, 0.2 / 0.7], [-0.1, -0.2 / 0.3]],
        rtol=1e-12,
    )


def test_the_jackknife_covariance_of_equal_steps_is_zero():
    assert not jackknife_covariance(np.tile([1.0, -2.0], (7, 1))).any()


def test_inflation_scales_some_rows_and_the_errors_correlated_with_them():
    rng = np.random.default_rng(6)
    half = rng.normal(size=(4, 9))
    covariance, rows = half @ half.T, np.array([1, 2])
    found = inflated(covariance, rows, 2.0)
    np.testing.assert_allclose(found[1:3], 4.0 * covariance[1:3], rtol=1e-12)
    # The covariance of the other rows, given these, is unchanged: that block of the inverse.
    others = np.ix_([0, 3], [0, 3])
    np.testing.assert_allclose(np.linalg.inv(found)[others], np.linalg.inv(covariance)[others])
    np.testing.assert_array_equal(inflated(covariance, np.array([], np.int64), 2.0), covariance)
