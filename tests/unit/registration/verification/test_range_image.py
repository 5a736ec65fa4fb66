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
    build_range_image,
    free_space_violation,
    minimum_filtered,
)
from scanlock.registration.verification.range_image import RangeImager
from scanlock.segmentation.ground.finder import GroundFinder
from scanlock.segmentation.segmentation import is_obstacle
from scanlock.simulation import scan_pair


def _image(points, **settings):
    return RangeImager(**settings).image(PointCloud.from_array(points))


def _violation(image, points, pose=None):
    points = read_only(np.asarray(points, float))
    return image.free_space_violation(
        points, pose or Pose.identity(), read_only(np.ones(len(points)))
    )


def _wall(distance, half=4.0, step=0.05):
    across = np.arange(-half, half, step)
    y, z = (one.ravel() for one in np.meshgrid(across, across))
    return np.column_stack([np.full(y.size, distance), y, z])


def _points_around(rng, count):
    """Points in all directions, a tenth of them at zero, some on the edges of the faces."""
    points = rng.normal(0.0, 8.0, (count, 3))
    points[::10] = 0.0
    points[5::10] = np.round(points[5::10])
    return points


def test_nearest_ranges_match_the_definition():
    points = _points_around(np.random.default_rng(0), 2000)
    expected = reference.build_range_image(points, 9)
    np.testing.assert_allclose(build_range_image(read_only(points), 9), expected, rtol=1e-12)
    assert np.isfinite(expected).mean() > 0.5


@pytest.mark.parametrize("neighbourhood", [0, 1, 3])
def test_nearest_ranges_around_match_the_definition(neighbourhood):
    ranges = reference.build_range_image(_points_around(np.random.default_rng(1), 300), 9)
    found = minimum_filtered(read_only(ranges), neighbourhood)
    np.testing.assert_array_equal(found, reference.minimum_filtered(ranges, neighbourhood))


def test_the_free_space_violation_matches_the_definition():
    rng = np.random.default_rng(2)
    ranges = reference.build_range_image(_points_around(rng, 900), 9)
    points, weights = _points_around(rng, 500), rng.random(500)
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
    expected = reference.free_space_violation(
        ranges, points, weights, pose, (0.4, 0.05), (1.0, 0.1)
    )
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    assert 100 < expected[0] < 400
    assert 0.1 < expected[2] / expected[1] < 0.9


def test_every_cell_has_a_direction():
    image = build_range_image(read_only(reference.every_cell(7)), 7)
    assert np.isfinite(image).all()


def test_a_scan_does_not_violate_its_own_free_space():
    points = _points_around(np.random.default_rng(3), 5000)
    assert _violation(_image(points), points) == 0.0


@pytest.mark.parametrize(
    ("distance", "expected"), [(12.0, 0.0), (10.0, 0.0), (9.75, 0.0), (9.6, 1.0), (6.0, 1.0)]
)
def test_only_points_in_front_of_the_margin_violate_free_space(distance, expected):
    # A small plate in front of a wall at 10 m: the margin is 0.2 m and 1 %.
    assert _violation(_image(_wall(10.0)), _wall(distance, half=0.5)) == expected


def test_points_in_directions_without_a_range_do_not_count():
    image = _image(_wall(10.0))
    behind = -_wall(6.0, half=0.5)
    assert math.isnan(_violation(image, behind))
    assert math.isnan(_violation(image, np.zeros((5, 3))))
    in_front = _wall(6.0, half=0.5)
    assert _violation(image, np.vstack([in_front, behind])) == 1.0


def test_occluded_points_do_not_count():
    image = _image(_wall(10.0))
    occluded = _wall(13.0, half=0.5)
    assert math.isnan(_violation(image, occluded))
    assert _violation(image, np.vstack([_wall(6.0, half=0.5), occluded])) == 1.0


def test_the_violation_is_unknown_with_too_few_points():
    image = _image(_wall(10.0))
    in_front = _wall(6.0, half=0.5)
    assert math.isnan(_violation(image, in_front[:5]))
    assert _violation(image, in_front[:6]) == 1.0


def test_the_violation_is_weighted():
    image = _image(_wall(10.0), min_points=2)
    points = read_only(np.array([[5.0, 0.0, 0.0], [11.0, 0.0, 0.0]]))
    weights = read_only(np.array([1.0, 3.0]))
    assert image.free_space_violation(points, Pose.identity(), weights) == 0.25


def test_a_thin_post_off_by_a_cell_does_not_violate_free_space():
    post = np.column_stack([np.full(100, 5.0), np.zeros(100), np.linspace(-1.0, 1.0, 100)])
    beside = post + np.array([0.0, 0.12, 0.0])
    scan = np.vstack([_wall(10.0), post])
    assert _violation(_image(scan, neighbourhood=0), beside) == 1.0
    assert _violation(_image(scan, neighbourhood=2), beside) == 0.0


def test_a_cloud_far_from_its_origin_has_no_range_image():
    assert _image(_wall(10.0) + np.array([5e5, 4e6, 0.0])) is None


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("cells_per_side", 0),
        ("neighbourhood", -1),
        ("margin", -0.1),
        ("relative_margin", 1.5),
        ("occlusion_margin", -1.0),
        ("relative_occlusion_margin", -0.1),
        ("min_points", 0),
    ],
)
def test_settings_out_of_range_are_refused(name, value):
    with pytest.raises(InvalidInput, match=name):
        RangeImager(**{name: value})


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["street", "forest"])
def test_wrong_poses_violate_free_space_more_than_the_correct_one(scene):
    pair = scan_pair(scene, "hdl_32e", 3, baseline=(5.0, 8.0))
    clouds = [PointCloud.from_array(one.points) for one in (pair.target, pair.source)]
    images = [RangeImager().image(one) for one in clouds]
    obstacles = [one.points[is_obstacle(one, GroundFinder().find(one))][::10] for one in clouds]

    def violation(pose):
        return 0.5 * (
            _violation(images[0], obstacles[1], pose)
            + _violation(images[1], obstacles[0], pose.inverse())
        )

    correct = violation(pair.target_from_source)
    wrong = [
        violation(pair.target_from_source @ yaw_pose(yaw, shift))
        for yaw, shift in ((0.1, (1.5, 1.5, 0.0)), (1.6, (0.0, 0.0, 0.0)), (3.1, (0.0, 0.0, 0.0)))
    ]
    assert correct < 0.03
    assert min(wrong) > max(3.0 * correct, 0.06)
