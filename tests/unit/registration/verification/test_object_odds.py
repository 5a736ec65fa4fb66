"""Log odds of a pose by low objects."""

import math
from dataclasses import replace

import numpy as np
import pytest

from scanlock.clouds.point_cloud import PointCloud
from scanlock.geometry.pose import Pose
from scanlock.registration.verification.features import features_from_clusters
from scanlock.registration.verification.object_odds import object_log_odds
from scanlock.segmentation.cluster_gaussians import ClusterGaussianExtractor


@pytest.fixture(scope="module")
def scan():
    """A square with five cars on one side, and the same with three of the cars elsewhere."""

    def points(cars):
        across = np.arange(-20.0, 20.0, 0.25)
        x, y = (one.ravel() for one in np.meshgrid(across, across))
        floor = np.column_stack([x, y, np.full(x.size, -1.7)])
        high, along = (one.ravel() for one in np.meshgrid(np.arange(-1.7, 4.0, 0.2), across))
        walls = [np.column_stack([along, np.full(along.size, side), high]) for side in (-20, 20)]
        return np.vstack([floor, *walls, *(_front(one) for one in cars)])

    def features(cars):
        cloud = PointCloud.from_array(points(cars))
        return features_from_clusters(ClusterGaussianExtractor().extract(cloud, [1.5]))

    parked = [(x, 8.0) for x in (-12.0, -6.0, 0.0, 6.0, 12.0)]
    moved = [*parked[:2], (3.0, -9.0), (9.0, -9.0), (-3.0, -9.0)]
    return features(parked), features(moved)


def _front(place):
    """The side of a car that faces the sensor."""
    along, high = (
        one.ravel() for one in np.meshgrid(np.arange(-2, 2, 0.1), np.arange(0, 1.4, 0.1))
    )
    x, y = place
    return np.column_stack([x + along, np.full(along.size, y), high - 1.6])


def _odds(target, source, pose=None, motions=()):
    return object_log_odds(target, source, pose or Pose.identity(), motions)


def test_objects_that_stay_support_the_pose(scan):
    parked, _ = scan
    # Five of either scan, each as likely in another place as the prior says.
    assert _odds(parked, parked) == pytest.approx(10 * math.log(0.92 / 0.3))


def test_missing_objects_contradict_it(scan):
    parked, moved = scan
    expected = 4 * math.log(0.92 / 0.3) - 6 * math.log((1.0 - 0.3) / 0.08)
    assert _odds(parked, moved) == pytest.approx(expected)


def test_objects_that_repeat_support_less(scan):
    parked, _ = scan
    # Four of five cars stand where another one does, on one side or on both.
    periods = [Pose(np.eye(3), np.array([x, 0.0, 0.0])) for x in (6.0, -6.0)]
    assert 0.0 <= _odds(parked, parked, motions=periods) < 0.5 * _odds(parked, parked)


def test_target_and_source_count_equally(scan):
    parked, moved = scan
    pose = Pose.from_step(np.array([0.2, 0.1, 0.0, 0.0, 0.0, 0.05]))
    turned = _odds(moved, parked, pose.inverse())
    assert _odds(parked, moved, pose) == pytest.approx(turned)


def test_without_a_sensor_nothing_is_known(scan):
    parked, _ = scan
    on_map = replace(parked, range_image=None)
    assert math.isnan(_odds(on_map, on_map))
    # The objects in the free space of the target.
    assert _odds(parked, on_map) == pytest.approx(5 * math.log(0.92 / 0.3))


def test_scans_without_objects_have_no_odds():
    across = np.arange(-20.0, 20.0, 0.25)
    x, y = (one.ravel() for one in np.meshgrid(across, across))
    cloud = PointCloud.from_array(np.column_stack([x, y, np.full(x.size, -1.7)]))
    features = features_from_clusters(ClusterGaussianExtractor().extract(cloud, [1.5]))
    assert _odds(features, features) == 0.0
