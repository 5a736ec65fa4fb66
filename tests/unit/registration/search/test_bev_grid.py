import math

import numpy as np
import pytest

from reference import plan_view as reference
from reference.samples import street
from scanlock.arrays import read_only
from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import InvalidInput
from scanlock.geometry.rotations import exp_rotation
from scanlock.kernels.search.bev_grid import column_slots, columns_and_ground
from scanlock.kernels.search.rotated_grids import turned_maps
from scanlock.registration.search.bev_grid import BevGridder, level_pose
from scanlock.segmentation.ground.finder import Ground, GroundFinder, GroundStatus


def _view(points, **settings):
    cloud = PointCloud.from_array(points)
    return BevGridder(**settings).view(cloud, GroundFinder().find(cloud))


def test_columns_are_those_of_the_definition():
    rng = np.random.default_rng(0)
    points = rng.uniform(-6.0, 6.0, (400, 3))
    heights = np.where(rng.random(400) < 0.3, math.nan, rng.uniform(-1.0, 6.0, 400))
    lies = rng.random(400) < 0.4
    stands = ~lies & (rng.random(400) < 0.7)
    level = np.column_stack([exp_rotation(np.array([0.1, -0.2, 0.5])), [0.2, -0.1, 1.0]])
    arguments = (points, heights, stands, lies, level)
    found = column_slots(*(read_only(one) for one in arguments), 8, 0.5, 0.5, 8)
    expected = reference.column_slots(*arguments, 8, 0.5, 0.5, 8)
    full_slots = [bits.bit_count() for bits in found[0].tolist()]
    np.testing.assert_array_equal(full_slots, expected[0].ravel())
    total, count = found[1].T
    np.testing.assert_array_equal(count > 0, ~np.isnan(expected[1].ravel()))
    seen = count > 0
    np.testing.assert_allclose(total[seen] / count[seen], expected[1].ravel()[seen], atol=1e-12)


def _holed_grid(rng):
    ground = rng.normal(size=(12, 12))
    ground[rng.random((12, 12)) < 0.5] = math.nan
    ground[:4, 4:8] = math.nan
    return ground


def test_full_and_open_columns_and_their_ground_are_those_of_the_definition():
    rng = np.random.default_rng(3)
    ground, slots = _holed_grid(rng), rng.integers(0, 3, (12, 12))
    counts = np.where(np.isnan(ground), 0.0, rng.integers(1, 9, (12, 12)))
    sums = np.column_stack([(np.nan_to_num(ground) * counts).ravel(), counts.ravel()])
    bits = np.array([0, 0b100, 0b1010])[slots.ravel()]
    found = columns_and_ground(read_only(bits), read_only(sums), 0.5, 4)
    expected = reference.full_and_open_columns(slots, ground, 0.5)
    for one, other in zip(found[:3], expected, strict=True):
        np.testing.assert_array_equal(one, other)
    np.testing.assert_allclose(found[3], reference.block_means(ground, 4), rtol=1e-12)
    assert np.isnan(found[3]).sum() == 1
    assert len(found[0]) > 50
    assert len(found[2]) > 10


def test_turned_maps_are_those_of_the_definition():
    rng = np.random.default_rng(1)
    columns, opened = rng.uniform(-30.0, 30.0, (80, 2)), rng.uniform(-30.0, 30.0, (120, 2))
    fills, headings = rng.uniform(0.1, 1.0, 80), np.array([0.0, 1.0, -2.5])
    arguments = (read_only(columns), read_only(fills), read_only(opened), 0.2)
    found = turned_maps(*arguments, read_only(headings), 2.0, 24)
    for one, heading in zip(found, headings, strict=True):
        expected = reference.turned_map(columns, fills, opened, 0.2, heading, 2.0, 24)
        np.testing.assert_array_equal(one, expected)


def test_a_post_fills_its_column_and_a_kerb_little_of_it():
    scan = street(1)
    heights = np.linspace(-1.2, 2.2, 60)
    post = np.column_stack([np.full((60, 2), [10.2, 5.2]), heights])
    kerb = post[heights < -0.9] - [0.0, 10.0, 0.0]
    view = _view(np.vstack([scan, post, kerb]))
    fills = {tuple(one): fill for one, fill in zip(view.columns.tolist(), view.fills, strict=True)}
    assert fills[10.25, 5.25] > 0.8
    assert fills[10.25, -4.75] < 0.3
    assert view.has_ground
    assert 20.0 < view.reach < 45.0
    assert not {tuple(one) for one in view.open_columns.tolist()} & set(fills)


def test_the_ground_of_a_tilted_scan_is_level_at_zero():
    tilt = exp_rotation(np.array([math.radians(20.0), math.radians(-10.0), 0.0]))
    view = _view(street(1) @ tilt.T)
    up = view.level_from_scan.rotation @ tilt @ [0.0, 0.0, 1.0]
    assert math.degrees(math.acos(up[2])) < 0.5
    known = view.ground[np.isfinite(view.ground)]
    assert len(known) > 200
    assert abs(np.median(known)) < 0.05
    assert view.ground_cell == 2.0


def test_without_ground_z_is_up_and_the_low_points_are_at_zero():
    cloud = PointCloud.from_array(np.random.default_rng(0).uniform(-5.0, 5.0, (1000, 3)))
    none = Ground.none(len(cloud), "none")
    pose = level_pose(cloud, none)
    np.testing.assert_array_equal(pose.rotation, np.eye(3))
    assert 0.01 < np.mean(pose.apply(cloud.points)[:, 2] < 0.0) < 0.03
    view = BevGridder().view(cloud, none)
    assert not view.has_ground
    assert none.status is GroundStatus.NONE
    assert len(view.open_columns) == 0
    assert np.isnan(view.ground).all()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"width": 0.0}, "width must be positive"),
        ({"slot": -1.0}, "slot must be positive"),
        ({"slots": 0}, "slots must be"),
        ({"slots": 63}, "slots must be"),
        ({"max_range": 0.0}, "max_range must be positive"),
    ],
)
def test_settings_out_of_range_are_refused(settings, message):
    with pytest.raises(InvalidInput, match=message):
        BevGridder(**settings)
