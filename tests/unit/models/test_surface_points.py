import numpy as np
import pytest

from reference import distribution_pairs as reference
from reference.samples import gaussians
from scanlock.errors import InvalidInput
from scanlock.models.gaussians import unpacked
from scanlock.models.surface_points import SurfacePoints, SurfaceVoxels


def _surface(seed, count=400):
    some = gaussians(np.random.default_rng(seed), count, half_width=6.0)
    return SurfacePoints(some.means, some.packed_covariances)


@pytest.mark.parametrize("voxel_size", [0.7, 2.0, 50.0])
def test_voxels_have_the_means_of_points_and_of_covariances(voxel_size):
    surface = _surface(1)
    voxels = SurfaceVoxels.from_points(surface, voxel_size)
    expected = reference.voxels(surface.points, unpacked(surface.covariances), voxel_size)
    assert len(voxels) == len(expected)
    assert [tuple(index) for index in voxels.indices] == sorted(expected)
    full = unpacked(voxels.surface.covariances)
    for row, index in enumerate(voxels.indices):
        mean, covariance = expected[tuple(index)]
        np.testing.assert_allclose(voxels.surface.points[row], mean, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(full[row], covariance, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("voxel_size", [0.7, 2.0, 50.0])
def test_a_query_finds_the_voxel_that_contains_it(voxel_size):
    voxels = SurfaceVoxels.from_points(_surface(2), voxel_size)
    queries = np.random.default_rng(3).uniform(-9.0, 9.0, (2000, 3))
    # Corners and faces belong to the upper voxel.
    queries = np.concatenate([queries, np.round(queries / voxel_size) * voxel_size])
    rows = {tuple(index): row for row, index in enumerate(voxels.indices)}
    expected = [rows.get(tuple(np.floor(query / voxel_size)), -1) for query in queries]
    assert len(set(expected)) > 2 or voxel_size == 50.0
    np.testing.assert_array_equal(voxels.rows_of(queries), expected)


def test_every_point_is_in_a_voxel_of_its_own_cloud():
    surface = _surface(4)
    voxels = SurfaceVoxels.from_points(surface, 1.0)
    rows = voxels.rows_of(surface.points)
    np.testing.assert_array_equal(voxels.indices[rows], np.floor(surface.points))
    np.testing.assert_array_equal(np.unique(rows), np.arange(len(voxels)))


def test_voxels_too_far_apart_for_one_integer_key_are_found():
    points = np.array([[0.5, 0.5, 0.5], [9e11, -9e11, 9e11], [-9e11, 0.5, 0.5]])
    voxels = SurfaceVoxels.from_points(SurfacePoints(points, np.ones((3, 6))), 0.1)
    np.testing.assert_array_equal(voxels.rows_of(points), [1, 2, 0])
    np.testing.assert_array_equal(voxels.rows_of(points + 0.2), [-1, -1, -1])


def test_arrays_are_read_only():
    voxels = SurfaceVoxels.from_points(_surface(5), 1.0)
    for array in (voxels.indices, voxels.surface.points, voxels.surface.covariances):
        assert not array.flags.writeable


def test_shapes_must_agree():
    with pytest.raises(InvalidInput, match=r"shapes \(n, 3\) and \(n, 6\), got .* and \(4, 6\)"):
        SurfacePoints(np.zeros((5, 3)), np.zeros((4, 6)))
