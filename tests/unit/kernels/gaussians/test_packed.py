import numpy as np

from reference.samples import rotated_covariances
from scanlock.arrays import read_only
from scanlock.geometry.rotations import exp_rotation
from scanlock.kernels.gaussians.packed import packed_inverses, packed_rotated
from scanlock.models.gaussians import unpacked


def _matrices(seed):
    rng = np.random.default_rng(seed)
    return rotated_covariances(rng, 10.0 ** rng.uniform(-3.0, 2.0, (60, 3)))


def _packed(matrices):
    return read_only(matrices[:, *np.triu_indices(3)])


def test_products_with_the_inverses_are_identities():
    matrices = _matrices(0)
    products = unpacked(packed_inverses(_packed(matrices))) @ matrices
    np.testing.assert_allclose(products, np.tile(np.eye(3), (60, 1, 1)), atol=1e-9)


def test_a_singular_matrix_has_no_finite_inverse():
    flat = np.diag([1.0, 0.0, 2.0])[None]
    assert not np.isfinite(packed_inverses(_packed(flat))).all()


def test_rotated_covariances_match_the_definition():
    matrices = _matrices(1)
    rotation = exp_rotation(np.array([0.3, -1.2, 0.8]))
    rotated = unpacked(packed_rotated(_packed(matrices), read_only(rotation)))
    np.testing.assert_allclose(rotated, rotation @ matrices @ rotation.T, rtol=1e-12, atol=1e-12)
