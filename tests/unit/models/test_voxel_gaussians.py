import pickle

import numpy as np
import pytest

from scanlock.errors import InvalidInput
from scanlock.kernels.gaussians.cells import cell_table
from scanlock.models.voxel_gaussians import VoxelGrid


def _by_cell(points, size, corner):
    cells = {}
    for point in points:
        cells.setdefault(tuple(np.floor((point - corner) / size).astype(int)), []).append(point)
    return cells


@pytest.mark.parametrize("offset", [0.0, 0.3])
def test_each_full_cell_has_the_unbiased_moments_of_its_points(offset):
    points = np.random.default_rng(0).normal(0.0, [3.0, 2.0, 1.0], (600, 3))
    grid = VoxelGrid(variance_ratio=0.0, min_deviation=1e-6, offset=offset)
    found = grid.gaussians(points, 1.5)
    cells = _by_cell(points, 1.5, 1.5 * offset)
    full = {cell: np.array(own) for cell, own in cells.items() if len(own) >= 6}
    assert {tuple(cell) for cell in found.cells.tolist()} == set(full)
    assert 10 < len(full) < len(cells)
    rows = zip(found.cells.tolist(), found.gaussians.means, found.gaussians.covariances,
               found.gaussians.counts, strict=True)  # fmt: skip
    for cell, mean, covariance, count in rows:
        own = full[tuple(cell)]
        assert count == len(own)
        np.testing.assert_allclose(mean, own.mean(axis=0), atol=1e-12)
        # The Point Cloud Library has (n - 1) / n where this has n / (n - 1).
        np.testing.assert_allclose(covariance, np.cov(own.T), atol=1e-9)


def test_small_variances_are_raised_to_a_fraction_of_the_largest():
    rng = np.random.default_rng(1)
    plane = np.column_stack([rng.uniform(0.1, 0.9, (200, 2)), np.full(200, 0.5)])
    [variances] = VoxelGrid(variance_ratio=0.01).gaussians(plane, 1.0).gaussians.variances
    np.testing.assert_allclose(variances[0], max(0.01 * variances[2], 0.01**2))
    point = np.full((20, 3), 0.5)
    [variances] = VoxelGrid(min_deviation=0.05).gaussians(point, 1.0).gaussians.variances
    np.testing.assert_allclose(variances, 0.05**2)


def test_cells_of_few_points_are_skipped():
    points = np.repeat([[0.5, 0.5, 0.5], [1.5, 0.5, 0.5]], [5, 6], axis=0)
    found = VoxelGrid().gaussians(points, 1.0)
    assert found.cells.tolist() == [[1, 0, 0]]
    assert len(VoxelGrid(min_points=7).gaussians(points, 1.0)) == 0


def test_points_on_a_face_belong_to_the_cell_of_the_points_and_not_of_their_mean():
    # The mean of seven times 0.3 is below 0.3 by rounding; the points are not.
    face = np.full((7, 3), 0.3)
    found = VoxelGrid().gaussians(face, 0.1)
    np.testing.assert_array_equal(found.cells[0], np.floor(face[0] / 0.1))


@pytest.mark.parametrize("far", [1.0, 1e6, 1e12])
def test_the_hash_table_has_the_row_of_every_cell(far):
    rng = np.random.default_rng(2)
    cells = np.unique(rng.integers(-40, 40, (900, 3)) * np.array([1, 7, int(far)]), axis=0)
    table = cell_table(cells, 2048)
    assert sorted(table[table >= 0].tolist()) == list(range(len(cells)))


def test_the_hash_table_is_at_most_an_eighth_full_and_never_empty():
    rng = np.random.default_rng(3)
    for count in (0, 1, 7, 8, 300):
        points = np.repeat(rng.permutation(2000)[:count, None] + 0.5, 6, axis=0) * np.ones(3)
        found = VoxelGrid().gaussians(points, 1.0)
        assert len(found) == count
        assert 8 * len(found) < len(found.table) <= max(2, 16 * len(found))


def test_pickled_voxels_are_the_same():
    found = VoxelGrid().gaussians(np.random.default_rng(4).normal(size=(200, 3)), 1.0)
    again = pickle.loads(pickle.dumps(found))
    np.testing.assert_array_equal(again.cells, found.cells)
    np.testing.assert_array_equal(again.gaussians.covariances, found.gaussians.covariances)
    np.testing.assert_array_equal(again.table, found.table)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"min_points": 1}, "min_points must be a whole number of at least 2"),
        ({"variance_ratio": -0.1}, "variance_ratio must lie between 0 and 1"),
        ({"min_deviation": 0.0}, "min_deviation must be positive, got 0.0 m"),
        ({"offset": 1.5}, "offset must lie between 0 and 1"),
    ],
)
def test_invalid_settings_are_rejected_by_name(settings, message):
    with pytest.raises(InvalidInput, match=message):
        VoxelGrid(**settings)


def test_a_voxel_size_of_zero_is_rejected():
    with pytest.raises(InvalidInput, match=r"voxel_size must be at least 0\.01 m, got 0"):
        VoxelGrid().gaussians(np.zeros((10, 3)), 0)
