import numpy as np
import pytest

from reference.samples import rotated_covariances
from scanlock.arrays import read_only
from scanlock.geometry.rotations import exp_rotation
from scanlock.kernels.gaussians.eigen3 import principal_axes, regularised_covariances
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


_UPPER = np.triu_indices(3)


_SPECTRA = {
    "round": (1.0, 1.0, 1.0),
    "flat": (1e-9, 1.0, 1.0),
    "exactly flat": (0.0, 1.0, 1.0),
    "long": (1e-9, 1e-9, 1.0),
    "a line": (0.0, 0.0, 1.0),
    "a point": (0.0, 0.0, 0.0),
    "nearly round": (1.0, 1.0 + 1e-12, 1.0 + 2e-12),
    "plain": (0.1, 0.7, 3.0),
    "tiny": (1e-140, 2e-140, 5e-140),
    "huge": (1e120, 2e120, 5e120),
    "of many scales": (1e-12, 1e-6, 1.0),
}


def _packed(full):
    return read_only(np.ascontiguousarray(full[:, _UPPER[0], _UPPER[1]]))


def _decomposed(full):
    variances, axes = principal_axes(_packed(full))
    return variances, axes.reshape(-1, 3, 3)


def _assert_decomposes(full):
    variances, axes = _decomposed(full)
    size = np.abs(full).max(axis=(1, 2), initial=0.0)[:, None]
    assert (np.abs(variances - np.linalg.eigvalsh(full)) <= 1e-14 * size).all()
    np.testing.assert_allclose(
        axes @ axes.transpose(0, 2, 1), np.tile(np.eye(3), (len(full), 1, 1)), atol=1e-14
    )
    product = np.einsum("na,nai,naj->nij", variances, axes, axes)
    assert (np.abs(product - full) <= 1e-14 * size[:, None]).all()


@pytest.mark.parametrize("spectrum", _SPECTRA)
def test_degenerate_matrices_are_decomposed(spectrum):
    rng = np.random.default_rng(7)
    rotations = np.array([np.eye(3)] + [exp_rotation(rng.normal(0.0, 2.0, 3)) for _ in range(200)])
    full = rotations @ np.diag(_SPECTRA[spectrum]) @ rotations.transpose(0, 2, 1)
    _assert_decomposes(0.5 * (full + full.transpose(0, 2, 1)))


def test_indefinite_matrices_are_decomposed():
    rng = np.random.default_rng(8)
    full = rng.normal(size=(300, 3, 3))
    _assert_decomposes(full + full.transpose(0, 2, 1))


def test_axes_of_distinct_variances_are_those_of_numpy():
    rng = np.random.default_rng(9)
    factors = rng.normal(size=(300, 3, 3))
    full = factors @ factors.transpose(0, 2, 1)
    _, axes = _decomposed(full)
    expected = np.linalg.eigh(full)[1].transpose(0, 2, 1)
    cosines = np.abs(np.einsum("nai,nai->na", axes, expected))
    np.testing.assert_allclose(cosines, 1.0, atol=1e-9)


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0), (1, 2, 0), (1, 0, 2), (0, 2, 1)])
def test_variances_ascend_for_any_order_on_the_diagonal(order):
    values = np.array([1.0, 2.0, 3.0])[list(order)]
    variances, axes = _decomposed(np.diag(values)[None])
    np.testing.assert_array_equal(variances, [[1.0, 2.0, 3.0]])
    np.testing.assert_array_equal(np.argmax(axes[0], axis=1), np.argsort(order))
