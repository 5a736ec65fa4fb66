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
from scanlock.registration.search.ground_alignment import align_grounds
from scanlock.segmentation.ground.finder import GroundFinder
from scanlock.simulation import scan_pair

_SEARCH = BevSearch()


def _grid(points, search=_SEARCH):
    cloud = PointCloud.from_array(points)
    return search.project(cloud, GroundFinder().find(cloud))


def _assert_near(pose, truth):
    """Check a pose to about one cell and one heading."""
    metres, radians = pose.distance(truth)
    assert metres < 2.5
    assert math.degrees(radians) < 6.0


@pytest.mark.parametrize("turn", [0.0, 1.0, 0.5 * math.pi, 2.5, -2.0, -0.5 * math.pi, math.pi])
def test_the_best_hypothesis_has_the_true_heading_and_translation(turn):
    truth = yaw_pose(turn, (12.0, -7.0, 0.3))
    found = _SEARCH.hypotheses(_grid(street(1)), _grid(truth.inverse().apply(street(2))))
    _assert_near(found[0].pose, truth)
    assert found[0].score == 1.0
    assert found[0].proposed_by == "BEV correlation"


def test_tilted_sensors_are_levelled():
    tilt = Pose(exp_rotation(np.array([0.3, -0.35, 0.0])), np.zeros(3))
    truth = yaw_pose(2.0, (5.0, 4.0, 0.0)) @ tilt
    found = _SEARCH.hypotheses(_grid(street(1)), _grid(truth.inverse().apply(street(2))))
    _assert_near(found[0].pose, truth)


@pytest.mark.slow
@pytest.mark.parametrize(("scene", "seed"), [("street", 3), ("forest", 3)])
def test_simulated_scans_fifteen_metres_apart_are_found(scene, seed):
    pair = scan_pair(scene, "os1_64", seed, baseline=(14.0, 16.0), turn=math.pi)
    found = _SEARCH.hypotheses(_grid(pair.target.points), _grid(pair.source.points))
    _assert_near(found[0].pose, pair.target_from_source)


def test_small_rooms_have_small_cells():
    # Cells of 2 m would not resolve the posts of a room of 8 m.
    truth = yaw_pose(1.9, (1.2, -0.7, 0.0))
    scans = [street(seed) * [0.2, 0.2, 1.0] for seed in (1, 2)]
    found = _SEARCH.hypotheses(_grid(scans[0]), _grid(truth.inverse().apply(scans[1])))
    metres, radians = found[0].pose.distance(truth)
    assert metres < 0.7
    assert math.degrees(radians) < 6.0


@pytest.mark.parametrize("turn", [0.3, 0.5 * math.pi, math.pi - 0.03, -0.5 * math.pi + 0.04])
def test_hypotheses_are_distinct_and_best_first(turn):
    # A peak at a right angle has neighbours in two quadrants.
    search = BevSearch(min_score_ratio=0.0)
    truth = yaw_pose(turn, (12.0, -7.0, 0.3))
    found = search.hypotheses(_grid(street(1)), _grid(truth.inverse().apply(street(2))))
    assert len(found) == search.max_hypotheses
    scores = [one.score for one in found]
    assert scores == sorted(scores, reverse=True)
    for k, one in enumerate(found):
        for other in found[:k]:
            metres, radians = one.pose.distance(other.pose)
            assert metres > 1.0 or math.degrees(radians) > 4.0


def test_a_grid_without_occupied_cells_has_no_hypothesis():
    empty = BevGrid(
        level_from_scan=Pose.identity(),
        has_ground=False,
        occupied_cells=np.empty((0, 2)),
        occupancy=np.empty(0),
        free_cells=np.empty((0, 2)),
        ground_heights=np.full((2, 2), np.nan),
        ground_cell_size=2.0,
    )
    assert empty.radius == 0.0
    assert _SEARCH.hypotheses(empty, _grid(street(1))) == []
    assert _SEARCH.hypotheses(_grid(street(1)), empty) == []


def test_whitening_by_the_square_root_equals_the_power_of_one_half():
    grids = _grid(street(1)), _grid(street(2))
    near = BevSearch(whitening=0.5 + 1e-12)
    for one, other in zip(_SEARCH.hypotheses(*grids), near.hypotheses(*grids), strict=True):
        assert one.pose == other.pose
        assert one.score == pytest.approx(other.score, abs=1e-3)


def _slope(seed, grade):
    """Random points of a hillside whose slope changes along x."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(-40.0, 40.0, (20000, 2))
    rise = 0.5 * grade / 40.0 * xy[:, 0] ** 2
    return np.column_stack([xy, rise + rng.normal(0.0, 0.02, len(xy))])


def test_the_shared_ground_corrects_height_roll_and_pitch():
    # Two positions on a hill of changing slope: each is levelled by its own ground.
    poses = [
        Pose(exp_rotation(np.array([0.0, 0.0, 0.4])), np.array([-10.0, 0.0, 3.0])),
        Pose(exp_rotation(np.array([0.05, -0.1, 2.0])), np.array([12.0, 5.0, 3.4])),
    ]
    grids = []
    for seed, pose in enumerate(poses):
        local = pose.inverse().apply(_slope(seed, 0.3))
        grids.append(_grid(local[np.linalg.norm(local[:, :2], axis=1) < 25.0]))
    truth = poses[0].inverse() @ poses[1]
    level = Pose(
        grids[0].level_from_scan.rotation.T
        @ _yaw_of(grids, truth)
        @ grids[1].level_from_scan.rotation,
        truth.translation + np.array([0.0, 0.0, 1.0]),
    )
    assert math.degrees(level.distance(truth)[1]) > 5.0
    aligned = align_grounds(*grids, level)
    assert math.degrees(aligned.distance(truth)[1]) < 0.8
    assert abs(aligned.translation[2] - truth.translation[2]) < 0.2
    # The position on the ground stays; a sensor 3 m above it moves by half a metre.
    assert np.linalg.norm((aligned.translation - level.translation)[:2]) < 0.6


def _yaw_of(grids, truth):
    level = grids[0].level_from_scan.rotation @ truth.rotation @ grids[1].level_from_scan.rotation.T
    yaw = math.atan2(level[1, 0] - level[0, 1], level[0, 0] + level[1, 1])
    return exp_rotation(np.array([0.0, 0.0, yaw]))


def test_a_pose_without_shared_ground_is_unchanged():
    far = yaw_pose(0.3, (500.0, 0.0, 0.0))
    grid = _grid(street(1))
    assert align_grounds(grid, grid, far) == far


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"headings": 0}, "headings must be"),
        ({"headings": 90}, "headings must be a multiple of four, got 90"),
        ({"free_cell_weight": -0.1}, "free_cell_weight must be"),
        ({"whitening": 1.1}, "whitening must lie"),
        ({"max_hypotheses": 0}, "max_hypotheses must be"),
        ({"min_score_ratio": -1.0}, "min_score_ratio must lie"),
    ],
)
def test_settings_out_of_range_are_refused(settings, message):
    with pytest.raises(InvalidInput, match=message):
        BevSearch(**settings)
