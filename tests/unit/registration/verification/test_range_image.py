import math

import numpy as np
import pytest

from reference import range_image as reference
from reference.samples import yaw_pose
from scanlock.arrays import read_only
from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.kernels.verification.range_image import (
    free_space_violation,
    nearest_around,
    nearest_ranges,
)
from scanlock.registration.verification.range_image import RangeImager
from scanlock.segmentation.ground.finder import GroundFinder
from scanlock.segmentation.segmentation import is_obstacle
from scanlock.simulation import scan_pair


def _image(points, **settings):
    return RangeImager(**settings).image(PointCloud.from_array(points))


def _share(image, points, pose=None):
    points = read_only(np.asarray(points, float))
    return image.free_space_violation(
        points, pose or Pose.identity(), read_only(np.ones(len(points)))
    )


def _wall(distance, half=4.0, step=0.05):
    across = np.arange(-half, half, step)
    y, z = (one.ravel() for one in np.meshgrid(across, across))
    return np.column_stack([np.full(y.size, distance), y, z])


def _directions(rng, count):
    """Points all around, a tenth of them at zero, some on the borders of the faces."""
    points = rng.normal(0.0, 8.0, (count, 3))
    points[::10] = 0.0
    points[5::10] = np.round(points[5::10])
    return points


def test_nearest_ranges_are_those_of_the_definition():
    points = _directions(np.random.default_rng(0), 2000)
    expected = reference.nearest_ranges(points, 9)
    np.testing.assert_allclose(nearest_ranges(read_only(points), 9), expected, rtol=1e-12)
    assert np.isfinite(expected).mean() > 0.5


@pytest.mark.parametrize("reach", [0, 1, 3])
def test_nearest_around_is_that_of_the_definition(reach):
    ranges = reference.nearest_ranges(_directions(np.random.default_rng(1), 300), 9)
    found = nearest_around(read_only(ranges), reach)
    np.testing.assert_array_equal(found, reference.nearest_around(ranges, reach))


def test_looked_through_is_that_of_the_definition():
    rng = np.random.default_rng(2)
    ranges = reference.nearest_ranges(_directions(rng, 900), 9)
    points, weights = _directions(rng, 500), rng.random(500)
    pose = Pose(exp_rotation(np.array([0.2, -0.1, 1.0])), np.array([1.0, -2.0, 0.5]))
    found = free_space_violation(
        read_only(ranges),
        read_only(points),
        read_only(weights),
        pose.rotation,
        pose.translation,
        0.4,
        0.05,
        1.0,
        0.1,
    )
    expected = reference.free_space_violation(ranges, points, weights, pose, 0.4, 0.05, 1.0, 0.1)
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    assert 100 < expected[0] < 400
    assert 0.1 < expected[2] / expected[1] < 0.9


def test_every_bin_has_a_place_of_its_own():
    image = nearest_ranges(read_only(reference.every_bin(7)), 7)
    assert np.isfinite(image).all()


def test_a_scan_violates_nothing_of_itself():
    points = _directions(np.random.default_rng(3), 5000)
    assert _share(_image(points), points) == 0.0


@pytest.mark.parametrize(
    ("distance", "share"), [(12.0, 0.0), (10.0, 0.0), (9.75, 0.0), (9.6, 1.0), (6.0, 1.0)]
)
def test_only_what_stands_clearly_before_a_wall_violates(distance, share):
    # A small plate, whose directions all meet the wall: 0.2 m and 1 % are forgiven.
    assert _share(_image(_wall(10.0)), _wall(distance, half=0.5)) == share


def test_what_is_where_nothing_was_seen_is_not_judged():
    image = _image(_wall(10.0))
    behind = -_wall(6.0, half=0.5)
    assert math.isnan(_share(image, behind))
    assert math.isnan(_share(image, np.zeros((5, 3))))
    before = _wall(6.0, half=0.5)
    assert _share(image, np.vstack([before, behind])) == 1.0


def test_what_is_hidden_says_nothing():
    image = _image(_wall(10.0))
    hidden = _wall(13.0, half=0.5)
    assert math.isnan(_share(image, hidden))
    # It waters nothing down.
    assert _share(image, np.vstack([_wall(6.0, half=0.5), hidden])) == 1.0


def test_a_few_points_say_nothing():
    image = _image(_wall(10.0))
    before = _wall(6.0, half=0.5)
    assert math.isnan(_share(image, before[:5]))
    assert _share(image, before[:6]) == 1.0


def test_weights_say_what_a_point_counts():
    image = _image(_wall(10.0), least_count=2)
    points = read_only(np.array([[5.0, 0.0, 0.0], [11.0, 0.0, 0.0]]))
    weights = read_only(np.array([1.0, 3.0]))
    assert image.free_space_violation(points, Pose.identity(), weights) == 0.25


def test_a_thin_post_in_the_wall_of_neighbours_is_forgiven():
    post = np.column_stack([np.full(100, 5.0), np.zeros(100), np.linspace(-1.0, 1.0, 100)])
    beside = post + np.array([0.0, 0.12, 0.0])
    scan = np.vstack([_wall(10.0), post])
    assert _share(_image(scan, reach=0), beside) == 1.0
    assert _share(_image(scan, reach=2), beside) == 0.0


def test_a_cloud_far_from_its_origin_has_no_image():
    assert _image(_wall(10.0) + np.array([5e5, 4e6, 0.0])) is None


@pytest.mark.parametrize(
    "setting",
    [
        {"side": 0}, {"reach": -1}, {"margin": -0.1}, {"share": 1.5}, {"hidden_margin": -1.0},
        {"hidden_share": -0.1}, {"least_count": 0},
    ],
)  # fmt: skip
def test_settings_out_of_range_are_refused(setting):
    with pytest.raises(InvalidInput):
        RangeImager(**setting)


@pytest.mark.parametrize("scene", ["street", "forest"])
def test_wrong_poses_violate_more_than_the_true_one(scene):
    pair = scan_pair(scene, "hdl_32e", 3, baseline=(5.0, 8.0))
    clouds = [PointCloud.from_array(one.points) for one in (pair.target, pair.source)]
    images = [RangeImager().image(one) for one in clouds]
    standing = [one.points[is_obstacle(one, GroundFinder().find(one))][::10] for one in clouds]

    def violation(pose):
        return 0.5 * (
            _share(images[0], standing[1], pose) + _share(images[1], standing[0], pose.inverse())
        )

    true = violation(pair.target_from_source)
    wrong = [
        violation(pair.target_from_source @ yaw_pose(turn, shift))
        for turn, shift in ((0.1, (1.5, 1.5, 0.0)), (1.6, (0.0, 0.0, 0.0)), (3.1, (0.0, 0.0, 0.0)))
    ]
    assert true < 0.03
    assert min(wrong) > max(3.0 * true, 0.06)
