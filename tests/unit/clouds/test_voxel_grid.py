import numpy as np
import pytest

from reference.grouping import partition
from reference.moments import moments as labelled
from scanlock.clouds.voxel_grid import voxel_indices, voxel_labels, voxel_means, voxel_moments
from scanlock.errors import InvalidInput


def _rows_by_voxel(points, voxel_size):
    """Rows of the points in each voxel, by ascending index of the voxel."""
    rows = {}
    for row, point in enumerate(points):
        rows.setdefault(tuple(np.floor(point / voxel_size)), []).append(row)
    return [rows[index] for index in sorted(rows)]


@pytest.mark.parametrize("voxel_size", [0.3, 1.0, 7.5])
@pytest.mark.parametrize("offset", [0.0, -9e3, 5e5])
def test_labels_and_means_match_the_definition(voxel_size, offset):
    rng = np.random.default_rng(1)
    points = rng.uniform(-4.0, 4.0, (300, 3)) + offset
    labels, count = voxel_labels(points, voxel_size)
    expected_rows = _rows_by_voxel(points, voxel_size)
    assert count == len(expected_rows)
    assert labels.dtype == np.int64
    for number, rows in enumerate(expected_rows):
        np.testing.assert_array_equal(np.flatnonzero(labels == number), rows)
    expected = [points[rows].mean(axis=0) for rows in expected_rows]
    found = voxel_means(points, voxel_size)
    np.testing.assert_allclose(found, expected, rtol=1e-13, atol=1e-13)


def test_indices_count_voxels_from_the_corner():
    points = np.random.default_rng(4).normal(0.0, 3.0, (2000, 3))
    corner = np.array([0.3, -0.2, 0.1])
    labels, indices = voxel_indices(points, 0.7, corner)
    np.testing.assert_array_equal(indices[labels], np.floor((points - corner) / 0.7))
    # More than the initial size of the hash table, each once, by ascending index.
    assert len(indices) > 500
    rows = list(map(tuple, indices.tolist()))
    assert rows == sorted(set(rows))
    np.testing.assert_array_equal(labels, voxel_labels(points - corner, 0.7)[0])


def test_a_far_point_does_not_merge_voxels():
    # Two sides of 2^32 voxels: the key's factor for x is then 2^64, which is zero.
    points = np.array([[0.5, 0.5, 0.5], [1.5, 0.5, 0.5], [0.5, 2.0**32 - 0.5, 2.0**32 - 0.5]])
    assert voxel_labels(points, 1.0)[1] == 3


def test_faces_belong_to_the_upper_voxel():
    points = np.array([[-1e-12, 0.0, 0.0], [0.0, 0.0, 0.0], [0.5, 0.999, 0.0], [1.0, 0.0, 0.0]])
    assert voxel_labels(points, 1.0)[0].tolist() == [0, 1, 1, 2]


def test_the_order_of_points_changes_no_voxel():
    rng = np.random.default_rng(2)
    points = rng.uniform(-4.0, 4.0, (200, 3))
    order = rng.permutation(200)
    np.testing.assert_array_equal(
        voxel_labels(points[order], 1.0)[0], voxel_labels(points, 1.0)[0][order]
    )


def test_no_points_give_no_voxels():
    labels, count = voxel_labels(np.empty((0, 3)), 1.0)
    assert (labels.shape, count) == ((0,), 0)
    assert voxel_means(np.empty((0, 3)), 1.0).shape == (0, 3)


@pytest.mark.parametrize("far", [[1e7, 2e7, -1e7], [1e12, 1e12, 1e12], [3.0, 3.0, 1e11]])
def test_one_far_point_changes_no_other_voxel(far):
    # Clouds accept coordinates up to 1e12 m.
    points = np.random.default_rng(3).uniform(-4.0, 4.0, (200, 3))
    labels, count = voxel_labels(np.vstack([points, [far]]), 1.0)
    expected, expected_count = voxel_labels(points, 1.0)
    assert count == expected_count + 1
    assert partition(labels[:-1]) == partition(expected)


@pytest.mark.parametrize("voxel_size", [0.0, -1.0, float("nan"), float("inf")])
def test_invalid_voxel_sizes_are_rejected_by_name(voxel_size):
    with pytest.raises(InvalidInput, match="voxel_size must be positive"):
        voxel_labels(np.zeros((1, 3)), voxel_size)


@pytest.mark.slow
@pytest.mark.parametrize(("voxel_size", "min_points"), [(0.15, 1), (0.7, 4), (6.0, 1)])
def test_moments_match_the_definition(voxel_size, min_points):
    # Some points are in runs of one voxel, and many voxels make the hash table grow.
    rng = np.random.default_rng(6)
    runs = np.repeat(rng.normal(0.0, 6.0, (300, 3)), rng.integers(1, 20, 300), axis=0)
    points = np.concatenate([rng.normal(0.0, 3.0, (2500, 3)), runs])
    points += rng.normal(0.0, 0.05, points.shape)
    corner = np.array([0.3, -0.2, 0.1])
    labels, every = voxel_indices(points, voxel_size, corner)
    counts, means, packed = labelled(points, labels, len(every))
    full = counts >= min_points
    found = voxel_moments(points, voxel_size, corner, min_points)
    assert len(every) > 1024 or voxel_size > 0.15
    np.testing.assert_array_equal(found[0], every[full])
    np.testing.assert_array_equal(found[1], counts[full])
    np.testing.assert_allclose(found[2], means[full], rtol=0.0, atol=1e-13)
    upper = packed[full][:, *np.triu_indices(3)]
    np.testing.assert_allclose(found[3], upper, rtol=0.0, atol=1e-13 * voxel_size**2 + 1e-15)


@pytest.mark.parametrize("index", [2**20 - 1, 2**20, 2**40])
@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [-1, 1])
def test_a_far_voxel_changes_no_other_moments(index, axis, sign):
    points = np.random.default_rng(7).uniform(-4.0, 4.0, (300, 3))
    near = voxel_moments(points, 0.5)
    far = np.zeros((3, 3))
    far[:, axis] = 0.5 * (sign * index + np.array([0.25, 0.5, 0.75]))
    indices, counts, means, packed = voxel_moments(np.vstack([points[:7], far, points[7:]]), 0.5)
    [row] = np.flatnonzero(np.abs(indices[:, axis]) > 8)
    assert indices[row, axis] == sign * index
    assert counts[row] == 3
    np.testing.assert_array_equal(means[row], far[1])
    np.testing.assert_allclose(packed[row].sum(), 0.125**2 * 2.0 / 3.0)
    others = [np.delete(array, row, axis=0) for array in (indices, counts, means, packed)]
    for one, other in zip(others, near, strict=True):
        np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-14)


def test_no_points_have_no_moments():
    shapes = [array.shape for array in voxel_moments(np.empty((0, 3)), 1.0)]
    assert shapes == [(0, 3), (0,), (0, 3), (0, 6)]


@pytest.mark.parametrize("far", [1.0, 1e12])
def test_means_and_moments_have_the_same_order_for_any_distance(far):
    # At 1e12 m the grid has more voxels than there are integers.
    rng = np.random.default_rng(5)
    points = rng.uniform(-4.0, 4.0, (60, 3))
    points[:5] *= far
    indices, counts, means, _ = voxel_moments(points, 1.0)
    rows = list(map(tuple, indices.tolist()))
    assert rows == sorted(set(rows))
    assert counts.sum() == 60
    np.testing.assert_allclose(voxel_means(points, 1.0), means, rtol=1e-14)
    np.testing.assert_array_equal(voxel_indices(points, 1.0)[1], indices)
