import numpy as np

from scanlock.optimisation.solvers.problem import Quadratic


def test_terms_are_unpacked_row_by_row_of_the_upper_triangle():
    terms = np.arange(28.0)
    quadratic = Quadratic.from_terms(terms)
    assert quadratic.value == 0.0
    np.testing.assert_array_equal(quadratic.gradient, np.arange(1.0, 7.0))
    hessian, k = quadratic.hessian, 7.0
    for a in range(6):
        for b in range(a, 6):
            assert hessian[a, b] == hessian[b, a] == k
            k += 1.0
