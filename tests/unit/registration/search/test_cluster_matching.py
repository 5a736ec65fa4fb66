import math

import numpy as np
import pytest

from reference.samples import gaussians, yaw_pose
from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation, rotation_onto_z
from scanlock.models.gaussians import Gaussians
from scanlock.registration.search.cluster_matching import ClusterMatcher
from scanlock.segmentation.cluster_gaussians import ClusterGaussianExtractor
from scanlock.segmentation.ground.finder import GroundFinder
from scanlock.simulation import scan_pair

_MATCHER = ClusterMatcher()
_TILTED = Pose(exp_rotation(np.array([0.9, -0.5, 2.0])), np.array([7.0, -4.0, 3.0]))
_NONE = Gaussians.from_covariances(np.empty((0, 3)), np.empty((0, 3, 3)), np.empty(0, np.int64))


def _world(seed=0, count=60):
    clusters = gaussians(np.random.default_rng(seed), count, half_width=20.0, max_deviation=1.0)
    return Gaussians.from_covariances(
        clusters.means * [1.0, 1.0, 0.1], clusters.covariances, clusters.counts
    )


def _source(world, target_from_source, seed=1):
    """Two thirds of the clusters with noise, and outliers, in the frame of the source."""
    rng = np.random.default_rng(seed)
    inliers = world.taken(rng.permutation(len(world))[: 2 * len(world) // 3])
    noise = rng.normal(0.0, 0.1, (len(inliers), 3))
    jittered = Gaussians.from_covariances(
        inliers.means + noise, 1.1 * inliers.covariances, inliers.counts
    )
    joined = Gaussians.joined([jittered, _world(seed + 50, len(world) // 3)])
    return joined.transformed(target_from_source.inverse())


def _assert_near(pose, truth, metres=0.3, degrees=2.0):
    translation, rotation = pose.distance(truth)
    assert translation < metres
    assert math.degrees(rotation) < degrees


@pytest.mark.parametrize("turn", [0.0, 1.0, -2.0, math.pi])
def test_level_scans_are_matched_at_any_heading(turn):
    truth = yaw_pose(turn, (12.0, -7.0, 0.3))
    level = Pose.identity()
    target = _MATCHER.describe(_world(), level)
    found = _MATCHER.hypotheses(target, _MATCHER.describe(_source(_world(), truth), level))
    _assert_near(found[0].pose, truth)
    assert found[0].proposed_by == "cluster matching"


def test_poses_are_between_the_frames_of_the_scans():
    level_from_scan = Pose(exp_rotation(np.array([0.3, -0.2, 0.0])), np.array([0.0, 0.0, 1.7]))
    level_from_other = Pose(exp_rotation(np.array([-0.1, 0.3, 0.0])), np.array([0.0, 0.0, 1.2]))
    level_truth = yaw_pose(2.0, (6.0, 5.0, 0.0))
    truth = level_from_scan.inverse() @ level_truth @ level_from_other
    target = _world().transformed(level_from_scan.inverse())
    source = _source(_world(), level_truth).transformed(level_from_other.inverse())
    features = (
        _MATCHER.describe(target, level_from_scan),
        _MATCHER.describe(source, level_from_other),
    )
    _assert_near(_MATCHER.hypotheses(*features)[0].pose, truth)


@pytest.mark.parametrize("level_from_scan", [None, Pose.identity()])
def test_scans_with_any_tilt_are_matched(level_from_scan):
    target = _MATCHER.describe(_world(), level_from_scan)
    source = _MATCHER.describe(_source(_world(), _TILTED), None)
    _assert_near(_MATCHER.hypotheses(target, source)[0].pose, _TILTED)
    _assert_near(_MATCHER.hypotheses(source, target)[0].pose, _TILTED.inverse())


def test_level_scans_on_different_slopes_are_matched():
    sloped = yaw_pose(1.0, (5.0, 3.0, 0.0)) @ Pose(
        exp_rotation(np.array([math.radians(8.0), 0.0, 0.0])), np.zeros(3)
    )
    level = Pose.identity()
    source = _MATCHER.describe(_source(_world(), sloped), level)
    found = _MATCHER.hypotheses(_MATCHER.describe(_world(), level), source)
    _assert_near(found[0].pose, sloped, metres=0.5, degrees=4.0)


def test_clusters_of_another_size_do_not_match():
    truth = yaw_pose(1.0, (3.0, 2.0, 0.0))
    source = _MATCHER.describe(_world().transformed(truth.inverse()).scaled(20.0), None)
    assert _MATCHER.hypotheses(_MATCHER.describe(_world(), None), source) == []


def _scan_features(points, is_level):
    cloud = PointCloud.from_array(points)
    ground = GroundFinder().find(cloud)
    clusters = ClusterGaussianExtractor().extract_above(cloud, ground, [3.0]).gaussians[0]
    height = np.array([0.0, 0.0, ground.sensor_height])
    level = Pose(rotation_onto_z(ground.up), height) if is_level else None
    return _MATCHER.describe(clusters, level)


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["street", "forest"])
def test_simulated_scans_fifteen_metres_apart_are_found(scene):
    pair = scan_pair(scene, "os1_64", 3, baseline=(14.0, 16.0), turn=math.pi)
    for is_level in (True, False):
        features = [_scan_features(scan.points, is_level) for scan in (pair.target, pair.source)]
        found = _MATCHER.hypotheses(*features)
        _assert_near(found[0].pose, pair.target_from_source, metres=2.5, degrees=8.0)


def test_hypotheses_are_distinct_sorted_and_repeatable():
    features = [_MATCHER.describe(_world(seed, 150), Pose.identity()) for seed in (3, 4)]
    found = _MATCHER.hypotheses(*features)
    assert 1 < len(found) <= _MATCHER.max_hypotheses
    scores = [one.score for one in found]
    assert scores == sorted(scores, reverse=True)
    assert scores[-1] >= 0.0
    for k, one in enumerate(found):
        assert not any(
            one.pose.is_close(other.pose, translation=1.0, rotation=math.radians(5.0))
            for other in found[:k]
        )
    assert found == _MATCHER.hypotheses(*features)
    assert len(ClusterMatcher(max_hypotheses=1).hypotheses(*features)) == 1


def test_another_scene_has_a_lower_score():
    target = _MATCHER.describe(_world(), None)
    right = _MATCHER.hypotheses(target, _MATCHER.describe(_source(_world(), _TILTED), None))
    wrong = _MATCHER.hypotheses(target, _MATCHER.describe(_world(9), None))
    assert right[0].score > 3.0 * max((one.score for one in wrong), default=0.0)


@pytest.mark.parametrize("clusters", [_NONE, _world(0, 1), _world(0, 2)])
@pytest.mark.parametrize("level_from_scan", [None, Pose.identity()])
def test_too_few_clusters_give_no_hypothesis(clusters, level_from_scan):
    few = _MATCHER.describe(clusters, level_from_scan)
    many = _MATCHER.describe(_world(), level_from_scan)
    for pair in ((few, many), (many, few), (few, few)):
        assert _MATCHER.hypotheses(*pair) == []


@pytest.mark.parametrize("level_from_scan", [None, Pose.identity()])
def test_coincident_and_collinear_clusters_do_not_raise(level_from_scan):
    clusters = _world()
    for means in (np.zeros((60, 3)), np.arange(60.0)[:, None] * [3.0, 0.0, 0.0]):
        same = Gaussians.from_covariances(
            means.copy(), np.array(clusters.covariances), np.array(clusters.counts)
        )
        features = _MATCHER.describe(same, level_from_scan)
        for one in _MATCHER.hypotheses(features, features):
            assert np.isfinite(one.pose.matrix).all()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"nearest": 0}, "nearest must be"),
        ({"max_matches": 0}, "max_matches must be"),
        ({"shape_tolerance": 0.0}, "shape_tolerance must be"),
        ({"distance_tolerance": -1.0}, "distance_tolerance must be"),
        ({"centre_variance_ratio": 1.5}, "centre_variance_ratio must lie"),
        ({"slope_tolerance": -0.1}, "slope_tolerance must be"),
        ({"angle_tolerance": 0.0}, "angle_tolerance must be"),
        ({"min_distance": 0.0}, "min_distance must be"),
        ({"consistency_thresholds": ()}, "consistency_thresholds must be ascending"),
        ({"consistency_thresholds": (2.0, 1.0)}, "consistency_thresholds must be ascending"),
        ({"consistency_thresholds": (0.0, 1.0)}, "consistency_thresholds must be positive"),
        ({"max_cliques": 0}, "max_cliques must be"),
        ({"overlap_deviation": 0.0}, "overlap_deviation must be"),
        ({"max_hypotheses": 0}, "max_hypotheses must be"),
    ],
)
def test_settings_out_of_range_are_refused(settings, message):
    with pytest.raises(InvalidInput, match=message):
        ClusterMatcher(**settings)


def test_the_clusters_of_the_most_points_are_matched():
    world = _world()
    described = ClusterMatcher(max_clusters=20).describe(world, None)
    assert len(described) == 20
    assert (described.centres == world.with_most_points(20).means).all()
