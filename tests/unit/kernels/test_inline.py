import numba
import numpy as np

from scanlock.kernels._inline import exp_negative


@numba.njit
def _exponential(x):
    # Helpers have no wrapper for calls from Python, only for those from kernels.
    return exp_negative(x)


def test_exp_negative_is_the_exponential():
    x = np.concatenate([[0.0], np.geomspace(1e-9, 100.0, 400)])
    np.testing.assert_allclose([_exponential(v) for v in x], np.exp(-x), rtol=0.0, atol=1e-13)
    assert 0.0 <= _exponential(1e9) < 1e-25
