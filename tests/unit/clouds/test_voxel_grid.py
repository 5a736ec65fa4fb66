import numpy as np
import pytest

from reference.grouping import partition
from scanlock.clouds.voxel_grid import voxel_cells, voxel_labels, voxel_means, voxel_moments
from scanlock.errors import InvalidInput


def _cubes(points, width):
    """The rows in each cube, by ascending index of the cube."""
    cubes = {}
    for row, point in enumerate(points):
        cubes.setdefault(tuple(np.floor(point / width)), []).append(row)
    return [cubes[index] for index in sorted(cubes)]


@pytest.mark.parametrize("width", [0.3, 1.0, 7.5])
@pytest.mark.parametrize("offset", [0.0, -9e3, 5e5])
def test_labels_and_means_match_the_definition(width, offset):
    rng = np.random.default_rng(1)
    points = rng.uniform(-4.0, 4.0, (300, 3)) + offset
    labels, count = voxel_labels(points, width)
    cubes = _cubes(points, width)
    assert count == len(cubes)
    assert labels.dtype == np.int64
    for number, rows in enumerate(cubes):
        np.testing.assert_array_equal(np.flatnonzero(labels == number), rows)
    expected = [points[rows].mean(axis=0) for rows in cubes]
    np.testing.assert_allclose(voxel_means(points, width), expected, rtol=1e-13, atol=1e-13)


def test_cells_are_the_indices_of_the_cubes_from_the_corner():
    points = np.random.default_rng(4).normal(0.0, 3.0, (2000, 3))
    corner = np.array([0.3, -0.2, 0.1])
    labels, cells = voxel_cells(points, 0.7, corner)
    np.testing.assert_array_equal(cells[labels], np.floor((points - corner) / 0.7))
    # More than the hash begins with, each once, by ascending index.
    assert len(cells) > 500
    rows = list(map(tuple, cells.tolist()))
    assert rows == sorted(set(rows))
    np.testing.assert_array_equal(labels, voxel_labels(points - corner, 0.7)[0])


def test_a_far_point_does_not_merge_voxels():
    # Two sides of 2^32 voxels: the key's factor for x is then 2^64, which is zero.
    points = np.array([[0.5, 0.5, 0.5], [1.5, 0.5, 0.5], [0.5, 2.0**32 - 0.5, 2.0**32 - 0.5]])
    assert voxel_labels(points, 1.0)[1] == 3


def test_faces_at_zero_belong_to_the_cube_above():
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
    # The gate lets coordinates through up to 1e12 m.
    points = np.random.default_rng(3).uniform(-4.0, 4.0, (200, 3))
    labels, count = voxel_labels(np.vstack([points, [far]]), 1.0)
    expected, expected_count = voxel_labels(points, 1.0)
    assert count == expected_count + 1
    assert partition(labels[:-1]) == partition(expected)


@pytest.mark.parametrize("width", [0.0, -1.0, float("nan"), float("inf")])
def test_widths_out_of_range_are_refused_by_name(width):
    with pytest.raises(InvalidInput, match="width must be positive"):
        voxel_labels(np.zeros((1, 3)), width)


@pytest.mark.parametrize("far", [1.0, 1e12])
def test_means_and_moments_stand_in_one_order_however_far_apart(far):
    # At 1e12 m the cubes between are too many to be numbered.
    rng = np.random.default_rng(5)
    points = rng.uniform(-4.0, 4.0, (60, 3))
    points[:5] *= far
    cells, counts, means, _ = voxel_moments(points, 1.0)
    rows = list(map(tuple, cells.tolist()))
    assert rows == sorted(set(rows))
    assert counts.sum() == 60
    np.testing.assert_allclose(voxel_means(points, 1.0), means, rtol=1e-14)
    np.testing.assert_array_equal(voxel_cells(points, 1.0)[1], cells)
