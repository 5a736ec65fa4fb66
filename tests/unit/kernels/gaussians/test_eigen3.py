import numpy as np
import pytest

from reference.samples import rotated_covariances
from scanlock.arrays import read_only
from scanlock.kernels.gaussians.eigen3 import regularised_covariances
from scanlock.models.gaussians import unpacked


def _regularised(covariances, minimum, ratio):
    """Definition, by LAPACK."""
    variances, axes = np.linalg.eigh(covariances)
    raised = np.maximum(variances, np.maximum(minimum, ratio * variances[:, -1:]))
    return np.einsum("kia,ka,kja->kij", axes, raised, axes), raised


def _assert_regularised(covariances, minimum, ratio):
    packed = read_only(covariances[:, *np.triu_indices(3)])
    raised, variances = regularised_covariances(packed, minimum, ratio)
    found = unpacked(raised), variances
    expected = _regularised(covariances, minimum, ratio)
    size = np.abs(covariances).max(axis=(1, 2), initial=0.0) + minimum
    assert (np.abs(found[0] - expected[0]).max(axis=(1, 2)) <= 1e-13 * size).all()
    assert (np.abs(found[1] - expected[1]).max(axis=1) <= 1e-13 * size).all()
    assert (np.diff(found[1], axis=1) >= 0.0).all()


@pytest.mark.parametrize(
    ("minimum", "ratio"), [(0.01, 0.0), (1e-4, 0.01), (1e-12, 0.3), (2.0, 0.0)]
)
def test_variances_are_raised_along_their_own_axes(minimum, ratio):
    rng = np.random.default_rng(0)
    variances = 10.0 ** rng.uniform(-8.0, 2.0, (500, 3))
    _assert_regularised(rotated_covariances(rng, variances), minimum, ratio)


def test_flat_round_and_empty_covariances_are_regularised():
    rotated = rotated_covariances(np.random.default_rng(1), np.array([[0.0, 0.0, 4.0], [0, 1, 1]]))
    special = [np.zeros((3, 3)), np.eye(3), np.diag([3.0, 1.0, 2.0]), np.ones((3, 3)), *rotated]
    _assert_regularised(np.array(special), 0.01, 0.001)
    found = regularised_covariances(read_only(np.empty((0, 6))), 0.01, 0.0)
    assert [array.shape for array in found] == [(0, 6), (0, 3)]


def test_regularisation_is_equivariant_to_the_scale():
    rng = np.random.default_rng(2)
    covariances = rotated_covariances(rng, 10.0 ** rng.uniform(-3.0, 1.0, (50, 3)))
    for factor in (1e-12, 1e12):
        _assert_regularised(factor * covariances, 1e-3 * factor, 0.01)
