import math
from functools import cache

import numpy as np
import pytest

from reference.real_pairs import PAIRS, real_pair
from reference.samples import street, yaw_pose
from scanlock.clouds.neighbours import Tessellation
from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.optimisation.objectives.constraints import Constraints, PosePrior
from scanlock.optimisation.objectives.robust_weights import RobustWeights
from scanlock.optimisation.solvers.bfgs import Bfgs
from scanlock.optimisation.solvers.criteria import ConvergenceCriteria, StopReason
from scanlock.optimisation.solvers.newton import Newton
from scanlock.registration.methods.gicp import Gicp
from scanlock.registration.methods.icp.correspondences import (
    NearestNeighbourSearch,
    VoxelSearch,
    typical_spacing,
)
from scanlock.registration.methods.icp.distance_rejection import (
    AdaptiveRejection,
    FixedRejection,
    TrimmedRejection,
)
from scanlock.registration.methods.protocol import InsufficientData, PreparationLog
from scanlock.registration.register import register

_SEARCHES = {"nearest": NearestNeighbourSearch(), "voxel": VoxelSearch()}
_with_each_search = pytest.mark.parametrize("search", _SEARCHES.values(), ids=_SEARCHES)

_ROBUST = {
    "fixed": {"rejection": FixedRejection(max_correspondence_distance=8.0)},
    "trimmed": {"rejection": TrimmedRejection()},
    "adaptive": {"rejection": AdaptiveRejection()},
    "huber": {"robust": RobustWeights(loss="huber")},
    "tukey": {"robust": RobustWeights(loss="tukey")},
    "trimmed, huber": {
        "rejection": TrimmedRejection(inlier_ratio=0.8),
        "robust": RobustWeights(loss="huber"),
    },
    "adaptive, tukey": {
        "rejection": AdaptiveRejection(),
        "robust": RobustWeights(loss="tukey"),
    },
}
_with_each_rejection_or_weight = pytest.mark.parametrize("settings", _ROBUST.values(), ids=_ROBUST)


def _within(*distances):
    return NearestNeighbourSearch(max_correspondence_distances=distances)


def _scan(points, method):
    return method.prepare(PointCloud.from_array(points))


def _aligned(method, motion, start=None, constraints=None):
    target, source = _scan(street(1), method), _scan(motion.inverse().apply(street(2)), method)
    return method.align(target, source, start or Pose.identity(), constraints or Constraints())


@_with_each_search
@pytest.mark.parametrize(
    "motion",
    [
        yaw_pose(0.02, (0.3, -0.2, 0.05)),
        yaw_pose(0.2, (2.0, -1.0, 0.1)),
        Pose.from_step(np.array([0.2, -0.4, 0.1, 0.05, -0.03, 0.1])),
    ],
)
def test_a_known_pose_is_recovered(search, motion):
    solution = _aligned(Gicp(search=search), motion)
    assert solution.reason is StopReason.STEP_SMALL
    # Noise of 2 cm over thousands of points; voxels of 1 m round off edges.
    assert solution.pose.is_close(motion, translation=0.03, rotation=2e-3)


@pytest.mark.slow
@_with_each_search
@_with_each_rejection_or_weight
def test_every_rejection_and_weight_recovers_a_known_pose(search, settings):
    motion = yaw_pose(0.02, (0.3, -0.2, 0.05))
    solution = _aligned(Gicp(search=search, **settings), motion)
    assert solution.reason is StopReason.STEP_SMALL
    assert solution.pose.is_close(motion, translation=0.03, rotation=2e-3)


@pytest.mark.slow
@pytest.mark.data
@pytest.mark.parametrize("pair", PAIRS)
@_with_each_search
@_with_each_rejection_or_weight
def test_every_rejection_and_weight_registers_real_scans(scan_data, pair, search, settings):
    # Of the settings, only whether distances are rejected is used in the preparation.
    rejection = FixedRejection() if "rejection" in settings else None
    prepared = Gicp(search=search, rejection=rejection)
    target, source, truth = _prepared_pair(scan_data, pair, prepared)
    solution = Gicp(search=search, **settings).align(target, source)
    assert solution.reason.is_converged
    # The reference poses are accurate to 1 to 3 cm, that of the campus to 0.3 degrees.
    assert solution.pose.is_close(truth, translation=0.05, rotation=math.radians(0.5))


@cache
def _prepared_pair(folder, pair, method):
    target, source, truth = real_pair(folder, pair)
    return _scan(target, method), _scan(source, method), truth


def _with_moved_objects(points):
    """A quarter of the points moved by 0.6 m: all objects in a sector, but not the ground."""
    azimuth = np.arctan2(points[:, 1], points[:, 0])
    is_moved = (points[:, 2] > -1.6) & (azimuth > 0.0) & (azimuth < 2.0)
    assert 0.2 < is_moved.mean() < 0.3
    return points + is_moved[:, None] * [0.5, 0.3, 0.0]


@pytest.mark.slow
@_with_each_search
def test_robust_weights_reduce_the_bias_of_moved_objects(search):
    motion = yaw_pose(0.02, (0.3, -0.2, 0.05))
    source = motion.inverse().apply(_with_moved_objects(street(2)))
    errors = {}
    for loss in ("none", "huber", "tukey"):
        method = Gicp(search=search, robust=RobustWeights(loss=loss))
        solution = method.align(_scan(street(1), method), _scan(source, method))
        assert solution.reason is StopReason.STEP_SMALL
        errors[loss] = solution.pose.distance(motion)[0]
    assert errors["tukey"] < 0.03 < 0.1 < errors["huber"] < 0.2 < errors["none"]


def test_a_trimmed_rejection_keeps_its_ratio_of_the_correspondences():
    motion = yaw_pose(0.02, (0.3, -0.2, 0.05))
    every = _aligned(Gicp(search=_within(1.0)), motion)
    method = Gicp(search=_within(1.0), rejection=TrimmedRejection(inlier_ratio=0.5))
    trimmed = _aligned(method, motion)
    assert trimmed.history[0].pairs == pytest.approx(0.5 * every.history[0].pairs, abs=1)
    assert trimmed.history[0].mean_distance < every.history[0].mean_distance


@_with_each_search
def test_an_adaptive_rejection_takes_its_good_distance_from_the_spacing_of_the_search(search):
    method = Gicp(search=search, rejection=AdaptiveRejection())
    target = _scan(street(1), method)
    if isinstance(search, NearestNeighbourSearch):
        spacing = typical_spacing(target.stages[-1].closest)
    else:
        spacing = search.voxel_sizes[-1]
    notes = method.align(target, target).notes
    assert AdaptiveRejection().note(spacing) in notes


def test_correspondences_of_zero_weight_are_an_empty_objective():
    # Equal scans have distances of zero, which the fixed scale makes outliers after a step.
    robust = RobustWeights(loss="tukey", scale=1e-9)
    start = yaw_pose(0.02, (0.3, -0.2, 0.05))
    solution = _aligned(Gicp(robust=robust), Pose.identity(), start)
    assert solution.reason is StopReason.EMPTY_OBJECTIVE
    assert solution.pose == start


@pytest.mark.parametrize(
    "solver", [Newton(), Bfgs(), Newton(criteria=ConvergenceCriteria(max_iterations=2))]
)
def test_the_pose_does_not_depend_on_the_solver(solver):
    motion = yaw_pose(0.1, (1.0, -0.5, 0.1))
    poses = [_aligned(Gicp(), motion).pose, _aligned(Gicp(solver=solver), motion).pose]
    assert poses[0].is_close(poses[1], translation=2e-3, rotation=1e-4)


@pytest.mark.slow
def test_the_pose_does_not_depend_on_the_algorithm_of_the_search():
    motion = yaw_pose(0.02, (0.3, -0.2, 0.05))
    method = Gicp(search=NearestNeighbourSearch(algorithm="delaunay"))
    assert isinstance(_scan(street(1), method).stages[0].closest, Tessellation)
    expected = _aligned(Gicp(), motion).pose
    assert _aligned(method, motion).pose.is_close(expected, translation=1e-9, rotation=1e-9)


def test_large_distances_widen_the_basin_and_small_ones_are_precise():
    motion = yaw_pose(0.2, (2.0, -1.0, 0.1))
    # Half of the target is missing, but large distances pair all of the source.
    target = street(1)[street(1)[:, 0] > 0.0]
    source = motion.inverse().apply(street(2))
    errors = []
    for distances in ((20.0,), (1.0,), (20.0, 5.0, 1.0)):
        method = Gicp(search=_within(*distances))
        solution = method.align(_scan(target, method), _scan(source, method), Pose.identity())
        errors.append(solution.pose.distance(motion)[0])
    large, small, both = errors
    assert both < 0.01 < 0.03 < large < 1.0 < small


@pytest.mark.parametrize("coarse_tolerance", [0.0, 0.0025, 0.1])
def test_each_stage_starts_from_the_pose_of_the_previous_one(coarse_tolerance):
    motion = yaw_pose(0.1, (1.0, 0.0, 0.0))
    coarse_step = max(1e-3, coarse_tolerance * 8.0)
    coarse = _aligned(Gicp(search=_within(8.0), step_tolerance=coarse_step), motion)
    fine = _aligned(Gicp(search=_within(1.0)), motion, start=coarse.pose)
    both = _aligned(Gicp(search=_within(8.0, 1.0), coarse_tolerance=coarse_tolerance), motion)
    assert both.pose == fine.pose
    assert len(both.history) == len(coarse.history) + len(fine.history)


def test_the_history_has_the_correspondences_and_begins_at_the_start():
    start, motion = yaw_pose(0.01, (0.1, 0.0, 0.0)), yaw_pose(0.02, (0.3, -0.2, 0.05))
    solution = _aligned(Gicp(), motion, start=start)
    assert solution.history[0].pose == start
    means = [one.mean_distance for one in solution.history if not math.isnan(one.mean_distance)]
    assert means[-1] < means[0] < 1.0
    pairs = [one.pairs for one in solution.history]
    assert all(count > 1000 for count in pairs)
    # Fewer source points have a target point within 1 m than within 20 m.
    assert pairs[-1] < pairs[0]
    count = len(_scan(motion.inverse().apply(street(2)), Gicp()).surface)
    assert solution.notes == (
        f"{pairs[-1]} correspondences, {pairs[-1] / count:.0%} of the source",
    )


@_with_each_search
def test_without_correspondences_the_start_is_returned(search):
    method, start = Gicp(search=search), yaw_pose(0.3, (300.0, 0.0, 0.0))
    scan = _scan(street(1), method)
    solution = method.align(scan, scan, start)
    assert solution.reason is StopReason.EMPTY_OBJECTIVE
    assert solution.pose == start
    assert solution.history[0].pose == start
    assert solution.history[0].pairs == 0


def test_the_start_is_returned_if_the_last_stage_has_no_correspondences():
    # There are correspondences within 20 m but, after the coarse stage, none within 0.1 mm.
    method = Gicp(search=_within(20.0, 0.0001))
    start = Pose.from_step(np.array([2.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    solution = method.align(_scan(street(1), method), _scan(street(2), method), start)
    assert solution.reason is StopReason.EMPTY_OBJECTIVE
    assert solution.pose == start
    assert len(solution.history) > 2


def test_the_iteration_limit_is_reported():
    solution = _aligned(Gicp(max_iterations=1), yaw_pose(0.3, (3.0, 2.0, 0.0)))
    assert solution.reason is StopReason.ITERATION_LIMIT


@_with_each_search
def test_locked_directions_keep_their_initial_values(search):
    start = Pose.from_step(np.array([0.1, 0.0, 0.25, 0.02, -0.01, 0.0]))
    motion = yaw_pose(0.1, (1.0, -0.5, 0.2))
    solution = _aligned(Gicp(search=search), motion, start, Constraints(dof="xy+yaw"))
    assert solution.pose.translation[2] == pytest.approx(start.translation[2], abs=1e-9)
    tilt = solution.pose.rotation @ start.rotation.T
    np.testing.assert_allclose(tilt[2], [0.0, 0.0, 1.0], atol=1e-9)
    assert solution.pose.distance(motion)[0] < 0.2


def test_a_precise_prior_determines_the_pose():
    motion, mean = yaw_pose(0.02, (0.3, -0.2, 0.05)), yaw_pose(0.05, (0.6, 0.0, 0.0))
    precise = Constraints(prior=PosePrior.from_deviations(mean, 1e-5, 1e-6))
    imprecise = Constraints(prior=PosePrior.from_deviations(mean, 100.0, 10.0))
    bound, free = (_aligned(Gicp(), motion, constraints=one).pose for one in (precise, imprecise))
    assert bound.is_close(mean, translation=1e-3, rotation=1e-4)
    assert free.is_close(_aligned(Gicp(), motion).pose, translation=1e-4, rotation=1e-5)


def test_prepare_downsamples_and_estimates_the_surface():
    log, method = PreparationLog(), Gicp(voxel_size=0.5)
    cloud = PointCloud.from_array(street(1))
    scan = method.prepare(cloud, log)
    assert len(scan.surface) < 4000 < len(cloud)
    assert scan.surface.points is scan.stages[0].closest.points
    assert [stage.scale for stage in scan.stages] == [20.0, 5.0, 1.0]
    assert log.notes == [f"{len(scan.surface)} surface points; 0 outliers removed"]
    assert set(log.seconds) == {"downsample", "surface", "search"}
    assert [one.scale for one in _scan(street(1), Gicp(search=VoxelSearch())).stages] == [
        8.0, 4.0, 2.0, 1.0,
    ]  # fmt: skip


def test_prepare_removes_outliers():
    outliers = [[1e6, 1e6, 0.0], [0.0, 0.0, 4e3], [-500.0, 0.0, 0.0]]
    log = PreparationLog()
    scan = Gicp().prepare(PointCloud.from_array(np.vstack([street(1), outliers])), log)
    plain = _scan(street(1), Gicp())
    assert log.notes == [f"{len(plain.surface)} surface points; 3 outliers removed"]
    np.testing.assert_array_equal(
        np.sort(scan.surface.points, axis=0), np.sort(plain.surface.points, axis=0)
    )
    # If all points are outliers, the scan is sparse and none is removed.
    sparse = _scan(1000.0 * street(1)[:500], Gicp())
    assert len(sparse.surface) == 500


def _corridor(seed, count=6000):
    rng = np.random.default_rng(seed)
    along, height = rng.uniform(-40.0, 40.0, count), rng.uniform(0.0, 3.0, count)
    across = rng.choice([-2.0, 2.0], count)
    return np.column_stack([along, across, height - 1.5]) + rng.normal(0.0, 0.02, (count, 3))


def test_coarse_stages_that_move_away_from_a_good_start_are_discarded():
    # A voxel as wide as the corridor contains both of its walls, with a mean between them.
    method = Gicp(search=VoxelSearch(voxel_sizes=(16.0, 1.0)))
    target, source = _scan(_corridor(1), method), _scan(_corridor(2), method)
    solution = method.align(target, source, Pose.identity())
    assert any("discarded" in note for note in solution.notes)
    # Plain walls do not constrain the translation along them and upwards.
    assert abs(solution.pose.translation[1]) < 0.01
    assert solution.pose.distance(Pose.identity())[1] < 0.01
    good = _aligned(Gicp(search=VoxelSearch()), yaw_pose(0.1, (1.0, -0.5, 0.1)))
    assert not any("discarded" in note for note in good.notes)


@_with_each_search
@pytest.mark.parametrize("count", [1, 3, 9])
def test_prepare_raises_for_fewer_than_ten_points(search, count):
    points = np.random.default_rng(0).uniform(-5.0, 5.0, (count, 3))
    with pytest.raises(InsufficientData, match=f"has {count} surface points; 10 are needed"):
        _scan(points, Gicp(search=search))


@_with_each_search
def test_register_accepts_the_method(search):
    motion = yaw_pose(0.2, (2.0, -1.0, 0.1))
    result = register(
        source=motion.inverse().apply(street(2)), target=street(1), method=Gicp(search=search)
    )
    assert result.ok, result.reason
    assert result.target_from_source.is_close(motion, translation=0.03, rotation=2e-3)
    assert result.method == "Gicp"


def test_the_covariance_factor_is_that_of_the_search():
    factors = [Gicp(search=search).covariance_factor for search in _SEARCHES.values()]
    assert factors == [1.20, 1.11]


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"voxel_size": 0.0}, "voxel_size must be positive"),
        ({"max_surface_radius": 0.0}, "max_surface_radius must be positive"),
        ({"neighbours": 3}, "neighbours must be a whole number of at least 4"),
        ({"shape": "sphere"}, "shape must be"),
        ({"covariance_epsilon": 0.0}, r"must be positive, got 0\.0 m\^2"),
        ({"step_tolerance": 0.0}, "step_tolerance must be positive"),
        ({"coarse_tolerance": -1.0}, "coarse_tolerance must lie between 0 and 1"),
        ({"max_iterations": 0}, "max_iterations must be a whole number"),
        ({"rotation_scale": 0.0}, "rotation_scale must be positive"),
    ],
)
def test_invalid_settings_raise(settings, message):
    with pytest.raises(InvalidInput, match=message):
        Gicp(**settings)
