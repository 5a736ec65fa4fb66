import math

import numpy as np
import pytest

from reference.samples import street, yaw_pose
from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.registration.search.bev_correlation import BevSearch
from scanlock.registration.search.bev_grid import BevGrid
from scanlock.registration.search.ground_alignment import ground_fitted
from scanlock.segmentation.ground.finder import GroundFinder
from scanlock.simulation import scan_pair

_SEARCH = BevSearch()


def _view(points, search=_SEARCH):
    cloud = PointCloud.from_array(points)
    return search.grid(cloud, GroundFinder().find(cloud))


def _assert_near(pose, truth):
    """Within a cell and a heading or so."""
    metres, radians = pose.distance(truth)
    assert metres < 2.5
    assert math.degrees(radians) < 6.0


@pytest.mark.parametrize("turn", [0.0, 1.0, 0.5 * math.pi, 2.5, -2.0, -0.5 * math.pi, math.pi])
def test_any_heading_and_shift_is_found_first(turn):
    truth = yaw_pose(turn, (12.0, -7.0, 0.3))
    found = _SEARCH.hypotheses(_view(street(1)), _view(truth.inverse().apply(street(2))))
    _assert_near(found[0].pose, truth)
    assert found[0].weight == 1.0
    assert found[0].proposed_by == "heading search"


def test_sensors_may_tilt():
    tilt = Pose(exp_rotation(np.array([0.3, -0.35, 0.0])), np.zeros(3))
    truth = yaw_pose(2.0, (5.0, 4.0, 0.0)) @ tilt
    found = _SEARCH.hypotheses(_view(street(1)), _view(truth.inverse().apply(street(2))))
    _assert_near(found[0].pose, truth)


@pytest.mark.parametrize(("scene", "seed"), [("street", 3), ("forest", 2)])
def test_simulated_scans_fifteen_metres_apart_are_found(scene, seed):
    pair = scan_pair(scene, "os1_64", seed, baseline=(14.0, 16.0), turn=math.pi)
    found = _SEARCH.hypotheses(_view(pair.target.points), _view(pair.source.points))
    _assert_near(found[0].pose, pair.target_from_source)


def test_small_rooms_get_small_cells():
    # Posts of a room of 8 m: cells of 2 m could not tell them apart.
    truth = yaw_pose(1.9, (1.2, -0.7, 0.0))
    scans = [street(seed) * [0.2, 0.2, 1.0] for seed in (1, 2)]
    found = _SEARCH.hypotheses(_view(scans[0]), _view(truth.inverse().apply(scans[1])))
    metres, radians = found[0].pose.distance(truth)
    assert metres < 0.7
    assert math.degrees(radians) < 6.0


@pytest.mark.parametrize("turn", [0.3, 0.5 * math.pi, math.pi - 0.03, -0.5 * math.pi + 0.04])
def test_hypotheses_are_distinct_and_best_first(turn):
    # A peak at a right angle has neighbours in two quarters of the circle.
    search = BevSearch(min_score_ratio=0.0)
    truth = yaw_pose(turn, (12.0, -7.0, 0.3))
    found = search.hypotheses(_view(street(1)), _view(truth.inverse().apply(street(2))))
    assert len(found) == search.max_hypotheses
    weights = [one.weight for one in found]
    assert weights == sorted(weights, reverse=True)
    for k, one in enumerate(found):
        for other in found[:k]:
            metres, radians = one.pose.distance(other.pose)
            assert metres > 1.0 or math.degrees(radians) > 4.0


def test_a_scan_that_shows_nothing_has_no_hypothesis():
    empty = BevGrid(
        Pose.identity(), False, np.empty((0, 2)), np.empty(0), np.empty((0, 2)),
        np.full((2, 2), np.nan), 2.0,
    )  # fmt: skip
    assert empty.reach == 0.0
    assert _SEARCH.hypotheses(empty, _view(street(1))) == []
    assert _SEARCH.hypotheses(_view(street(1)), empty) == []


def test_whitening_by_the_root_is_the_power_of_a_half():
    views = _view(street(1)), _view(street(2))
    near = BevSearch(whitening=0.5 + 1e-12)
    for one, other in zip(_SEARCH.hypotheses(*views), near.hypotheses(*views), strict=True):
        assert one.pose == other.pose
        assert one.weight == pytest.approx(other.weight, abs=1e-3)


def _slope(seed, grade):
    """A hillside whose steepness changes along x, seen at random."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(-40.0, 40.0, (20000, 2))
    rise = 0.5 * grade / 40.0 * xy[:, 0] ** 2
    return np.column_stack([xy, rise + rng.normal(0.0, 0.02, len(xy))])


def test_the_shared_ground_settles_height_roll_and_pitch():
    # Two places on a hill that steepens: each is level by its own ground, not by the other's.
    poses = [
        Pose(exp_rotation(np.array([0.0, 0.0, 0.4])), np.array([-10.0, 0.0, 3.0])),
        Pose(exp_rotation(np.array([0.05, -0.1, 2.0])), np.array([12.0, 5.0, 3.4])),
    ]
    views = []
    for seed, pose in enumerate(poses):
        local = pose.inverse().apply(_slope(seed, 0.3))
        views.append(_view(local[np.linalg.norm(local[:, :2], axis=1) < 25.0]))
    truth = poses[0].inverse() @ poses[1]
    level = Pose(
        views[0].level_from_scan.rotation.T
        @ _yaw_of(views, truth)
        @ views[1].level_from_scan.rotation,
        truth.translation + np.array([0.0, 0.0, 1.0]),
    )
    assert math.degrees(level.distance(truth)[1]) > 5.0
    fitted = ground_fitted(*views, level)
    assert math.degrees(fitted.distance(truth)[1]) < 0.8
    assert abs(fitted.translation[2] - truth.translation[2]) < 0.2
    # The place on the ground is left to others: a sensor 3 m above it swings by half a metre.
    assert np.linalg.norm((fitted.translation - level.translation)[:2]) < 0.6


def _yaw_of(views, truth):
    level = views[0].level_from_scan.rotation @ truth.rotation @ views[1].level_from_scan.rotation.T
    yaw = math.atan2(level[1, 0] - level[0, 1], level[0, 0] + level[1, 1])
    return exp_rotation(np.array([0.0, 0.0, yaw]))


def test_without_shared_ground_a_hypothesis_stays_as_it_was():
    far = yaw_pose(0.3, (500.0, 0.0, 0.0))
    view = _view(street(1))
    assert ground_fitted(view, view, far) == far


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"headings": 0}, "headings must be"),
        ({"headings": 90}, "headings must be a multiple of four, got 90"),
        ({"openness": -0.1}, "openness must be"),
        ({"whitening": 1.1}, "whitening must lie"),
        ({"most": 0}, "most must be"),
        ({"least_share": -1.0}, "least_share must lie"),
    ],
)
def test_settings_out_of_range_are_refused(settings, message):
    with pytest.raises(InvalidInput, match=message):
        BevSearch(**settings)
