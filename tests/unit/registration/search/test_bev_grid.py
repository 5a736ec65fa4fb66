import math

import numpy as np
import pytest

from reference import bev_grid as reference
from reference.samples import street
from scanlock.arrays import read_only
from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import InvalidInput
from scanlock.geometry.rotations import exp_rotation
from scanlock.kernels.search.bev_grid import cells_and_ground, occupied_height_bins
from scanlock.kernels.search.rotated_grids import rotated_grids
from scanlock.registration.search.bev_grid import BevProjector, level_pose
from scanlock.segmentation.ground.finder import Ground, GroundFinder, GroundStatus


def _grid(points):
    cloud = PointCloud.from_array(points)
    return BevProjector().project(cloud, GroundFinder().find(cloud))


def test_height_bins_are_those_of_the_definition():
    rng = np.random.default_rng(0)
    points = rng.uniform(-6.0, 6.0, (400, 3))
    heights = np.where(rng.random(400) < 0.3, math.nan, rng.uniform(-1.0, 6.0, 400))
    is_ground = rng.random(400) < 0.4
    is_obstacle = ~is_ground & (rng.random(400) < 0.7)
    level = np.column_stack([exp_rotation(np.array([0.1, -0.2, 0.5])), [0.2, -0.1, 1.0]])
    arguments = (points, heights, is_obstacle, is_ground, level)
    found = occupied_height_bins(*(read_only(one) for one in arguments), 8, 0.5, 0.5, 8)
    expected = reference.height_bins(*arguments, 8, 0.5, 0.5, 8)
    counts = [bits.bit_count() for bits in found[0].tolist()]
    np.testing.assert_array_equal(counts, expected[0].ravel())
    total, count = found[1].T
    has_ground = count > 0
    np.testing.assert_array_equal(has_ground, ~np.isnan(expected[1].ravel()))
    means = total[has_ground] / count[has_ground]
    np.testing.assert_allclose(means, expected[1].ravel()[has_ground], atol=1e-12)


def _holed_grid(rng):
    ground = rng.normal(size=(12, 12))
    ground[rng.random((12, 12)) < 0.5] = math.nan
    ground[:4, 4:8] = math.nan
    return ground


def test_occupied_and_free_cells_and_ground_heights_are_those_of_the_definition():
    rng = np.random.default_rng(3)
    ground, bin_counts = _holed_grid(rng), rng.integers(0, 3, (12, 12))
    counts = np.where(np.isnan(ground), 0.0, rng.integers(1, 9, (12, 12)))
    sums = np.column_stack([(np.nan_to_num(ground) * counts).ravel(), counts.ravel()])
    bits = np.array([0, 0b100, 0b1010])[bin_counts.ravel()]
    found = cells_and_ground(read_only(bits), read_only(sums), 0.5, 4)
    expected = reference.occupied_and_free_cells(bin_counts, ground, 0.5)
    for one, other in zip(found[:3], expected, strict=True):
        np.testing.assert_array_equal(one, other)
    np.testing.assert_allclose(found[3], reference.block_means(ground, 4), rtol=1e-12)
    assert np.isnan(found[3]).sum() == 1
    assert len(found[0]) > 50
    assert len(found[2]) > 10


def test_rotated_grids_are_those_of_the_definition():
    rng = np.random.default_rng(1)
    occupied, free = rng.uniform(-30.0, 30.0, (80, 2)), rng.uniform(-30.0, 30.0, (120, 2))
    occupancy, headings = rng.uniform(0.1, 1.0, 80), np.array([0.0, 1.0, -2.5])
    arguments = (read_only(occupied), read_only(occupancy), read_only(free), 0.2)
    found = rotated_grids(*arguments, read_only(headings), 2.0, 24)
    for one, heading in zip(found, headings, strict=True):
        expected = reference.rotated_grid(occupied, occupancy, free, 0.2, heading, 2.0, 24)
        np.testing.assert_array_equal(one, expected)


def test_a_post_has_a_higher_occupancy_than_a_kerb():
    scan = street(1)
    heights = np.linspace(-1.2, 2.2, 60)
    post = np.column_stack([np.full((60, 2), [10.2, 5.2]), heights])
    kerb = post[heights < -0.9] - [0.0, 10.0, 0.0]
    grid = _grid(np.vstack([scan, post, kerb]))
    cells = [tuple(one) for one in grid.occupied_cells.tolist()]
    occupancy = dict(zip(cells, grid.occupancy, strict=True))
    assert occupancy[10.25, 5.25] > 0.8
    assert occupancy[10.25, -4.75] < 0.3
    assert grid.has_ground
    assert 20.0 < grid.radius < 45.0
    assert not {tuple(one) for one in grid.free_cells.tolist()} & set(cells)


def test_a_tilted_scan_is_levelled_with_its_ground_at_zero():
    tilt = exp_rotation(np.array([math.radians(20.0), math.radians(-10.0), 0.0]))
    grid = _grid(street(1) @ tilt.T)
    up = grid.level_from_scan.rotation @ tilt @ [0.0, 0.0, 1.0]
    assert math.degrees(math.acos(up[2])) < 0.5
    known = grid.ground_heights[np.isfinite(grid.ground_heights)]
    assert len(known) > 200
    assert abs(np.median(known)) < 0.05
    assert grid.ground_cell_size == 2.0


def test_without_a_ground_z_is_up_and_the_lowest_points_are_at_zero():
    cloud = PointCloud.from_array(np.random.default_rng(0).uniform(-5.0, 5.0, (1000, 3)))
    none = Ground.none(len(cloud), "none")
    pose = level_pose(cloud, none)
    np.testing.assert_array_equal(pose.rotation, np.eye(3))
    assert 0.01 < np.mean(pose.apply(cloud.points)[:, 2] < 0.0) < 0.03
    grid = BevProjector().project(cloud, none)
    assert not grid.has_ground
    assert none.status is GroundStatus.NONE
    assert len(grid.free_cells) == 0
    assert np.isnan(grid.ground_heights).all()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"cell_size": 0.0}, "cell_size must be positive"),
        ({"bin_height": -1.0}, "bin_height must be positive"),
        ({"height_bins": 0}, "height_bins must be"),
        ({"height_bins": 63}, "height_bins must be at most 62, got 63"),
        ({"max_range": 0.0}, "max_range must be positive"),
    ],
)
def test_settings_out_of_range_are_refused(settings, message):
    with pytest.raises(InvalidInput, match=message):
        BevProjector(**settings)
