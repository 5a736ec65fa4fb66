"""Low objects of a scan, against their definition and on simulated scenes."""

import numpy as np
import pytest

from reference import low_objects as reference
from scanlock.arrays import read_only
from scanlock.clouds.point_cloud import PointCloud
from scanlock.geometry.rotations import exp_rotation
from scanlock.kernels.verification.low_objects import (
    joined_voxels,
    low_voxels,
    near_obstacles,
    occupied_columns,
)
from scanlock.registration.verification.low_objects import find_low_objects
from scanlock.segmentation.cluster_gaussians import ClusterGaussianExtractor

_TILT = exp_rotation(np.array([0.05, -0.08, 0.7]))


def _objects(points):
    cloud = PointCloud.from_array(points)
    return find_low_objects(ClusterGaussianExtractor().extract(cloud, [1.5]))


def _box(centre, half, step=0.08):
    """Points on the surface of an upright box."""
    axes = [np.arange(-one, one + 1e-9, step) for one in half]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    on_surface = (np.abs(grid) >= np.array(half) - 0.5 * step).any(axis=1)
    return grid[on_surface] + centre


def _floor(half=20.0, step=0.25):
    across = np.arange(-half, half, step)
    x, y = (one.ravel() for one in np.meshgrid(across, across))
    return np.column_stack([x, y, np.full(x.size, -1.7)])


def test_low_voxels_match_the_definition():
    rng = np.random.default_rng(0)
    points = rng.uniform((-8, -8, -2), (8, 8, 2), (6000, 3)) * [1.0, 1.0, 0.7]
    heights = points[:, 2] + 1.0
    heights[::50] = np.nan
    found, means = low_voxels(
        read_only(points), read_only(heights), read_only(_TILT), 2.0, 7.5, 0.3, 0.5, 3, 4, 2
    )
    expected = reference.low_voxels(points, heights, _TILT, (2.0, 7.5), 0.3, 0.5, (3, 4), 2)
    assert len(found) == len(expected) > 50
    half = 2 * int(np.ceil(0.5 * 7.5 / 0.5))
    for (i, j, layer), mean in zip(found, means, strict=True):
        np.testing.assert_allclose(mean, expected[i - half, j - half, layer], atol=1e-12)


def test_joined_voxels_match_the_definition():
    rng = np.random.default_rng(1)
    voxels = np.unique(rng.integers(0, 9, (60, 3)), axis=0)
    rng.shuffle(voxels)
    labels, count = joined_voxels(read_only(voxels))
    groups = {frozenset(np.flatnonzero(labels == one).tolist()) for one in range(count)}
    assert groups == reference.joined(voxels)
    assert 1 < count < len(voxels)
    first_rows = [int(np.flatnonzero(labels == one)[0]) for one in range(count)]
    assert first_rows == sorted(first_rows)


def test_occupied_columns_and_near_obstacles_match_the_definition():
    rng = np.random.default_rng(2)
    points = rng.normal(0.0, 2.5, (40, 3))
    columns = occupied_columns(read_only(points), read_only(_TILT), -3.0, 0.4, 20)
    bins = reference.occupied_bins(points, _TILT, -3.0, 0.4, 20)
    found = {
        (i, j, b) for i, j in np.argwhere(columns) for b in range(64) if int(columns[i, j]) >> b & 1
    }
    assert found == bins
    queries = rng.normal(0.0, 1.5, (400, 3))
    found = near_obstacles(read_only(columns), read_only(_TILT), -3.0, 0.4, 0.8, read_only(queries))
    expected = [reference.is_near(bins, _TILT, -3.0, 0.4, 20, 0.8, one) for one in queries]
    np.testing.assert_array_equal(found, expected)
    assert 0.1 < found.mean() < 0.9


def test_a_car_is_a_low_object_and_a_wall_is_not():
    car = _box([6.0, 4.0, -1.0], [2.0, 0.9, 0.7])
    wall = _box([0.0, -9.0, 0.3], [12.0, 0.1, 2.0])
    found = _objects(np.vstack([_floor(), car, wall]))
    assert found.count == 1
    np.testing.assert_allclose(found.voxels.mean(axis=0), [6.0, 4.0, -1.0], atol=0.4)


def test_objects_that_are_too_long_or_too_near_are_no_objects():
    hedge = _box([6.0, 6.0, -1.2], [5.0, 0.4, 0.5])
    carrier = _box([0.6, 0.0, -1.0], [0.3, 0.3, 0.7])
    assert _objects(np.vstack([_floor(), hedge, carrier])).count == 0


def test_objects_turn_with_the_scan():
    points = np.vstack([_floor(), _box([6.0, 4.0, -1.0], [2.0, 0.9, 0.7])])
    turn = exp_rotation(np.array([0.1, 0.05, 2.0]))
    found, turned = _objects(points), _objects(points @ turn.T)
    assert turned.count == found.count == 1
    middle, turned_middle = found.voxels.mean(axis=0), turned.voxels.mean(axis=0)
    np.testing.assert_allclose(turned_middle, turn @ middle, atol=0.3)


def test_a_scan_without_ground_has_columns_but_maybe_no_objects():
    rng = np.random.default_rng(3)
    found = _objects(rng.normal(0.0, 10.0, (3000, 3)))
    assert found.occupied.columns.any()
    assert len(found.voxels) == len(found.object_of_voxel)


@pytest.mark.parametrize("sets", [1, 3])
def test_counts_are_those_of_each_set(sets):
    found = _objects(
        np.vstack([_floor(), *(_box([6.0, y, -1.0], [2.0, 0.9, 0.7]) for y in (-6, 0, 6))])
    )
    selected = np.random.default_rng(4).random(sets * len(found.voxels)) < 0.3
    expected = [
        [np.count_nonzero(one[found.object_of_voxel == k]) for k in range(found.count)]
        for one in selected.reshape(sets, -1)
    ]
    np.testing.assert_array_equal(found.counts(selected), expected)
    assert found.count == 3
