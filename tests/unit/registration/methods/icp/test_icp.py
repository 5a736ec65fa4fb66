import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from reference.point_scans import RecordingRejection, point_scan
from reference.samples import street, yaw_pose
from scanlock.clouds.neighbours import Tessellation
from scanlock.clouds.point_cloud import PointCloud
from scanlock.clouds.point_tree import PointTree
from scanlock.clouds.voxel_grid import voxel_means
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.models.sensor_noise import SensorNoise
from scanlock.models.surfaces import surface_normals
from scanlock.optimisation.objectives.constraints import Constraints, PosePrior
from scanlock.optimisation.objectives.robust_weights import RobustWeights
from scanlock.optimisation.solvers.annealing import Annealing
from scanlock.optimisation.solvers.criteria import StopReason
from scanlock.registration.methods.icp.annealing import AnnealedStart
from scanlock.registration.methods.icp.correspondences import typical_spacing
from scanlock.registration.methods.icp.distance_rejection import (
    AdaptiveRejection,
    FixedRejection,
    TrimmedRejection,
)
from scanlock.registration.methods.icp.history import IcpConvergenceCriteria
from scanlock.registration.methods.icp.icp import Icp
from scanlock.registration.methods.icp.transform_estimation import TransformEstimation
from scanlock.registration.methods.protocol import InsufficientData, PreparationLog

_MOTION = yaw_pose(0.05, (0.5, -0.3, 0.1))
_PLANES = TransformEstimation(algorithm="gauss-newton", residual="point-to-plane")
_ESTIMATIONS = {
    algorithm: TransformEstimation(algorithm=algorithm)
    for algorithm in ("svd", "quaternion", "gauss-newton")
}
_ESTIMATIONS["planes"] = _PLANES
_LATTICE = 10.0 * np.array(list(itertools.product(range(4), repeat=3)), np.float64) - 15.0
"""Points too far apart for another point to become the nearest."""


def _scan(points, method):
    return method.prepare(PointCloud.from_array(points))


def _sides(method, motion=_MOTION, count=6000):
    return _scan(street(1, count), method), _scan(motion.inverse().apply(street(2, count)), method)


def _aligned(method, motion=_MOTION, start=None, constraints=None, count=6000):
    sides = _sides(method, motion, count)
    return method.align(*sides, start or Pose.identity(), constraints or Constraints())


_VARIANTS = {
    "svd": Icp(),
    "quaternion": Icp(estimation=TransformEstimation(algorithm="quaternion")),
    "gauss-newton": Icp(estimation=TransformEstimation(algorithm="gauss-newton")),
    "tessellation": Icp(search="delaunay"),
    "planes": Icp(estimation=_PLANES),
    "all points": Icp(voxel_size=None),
    "noise": Icp(noise=SensorNoise()),
    "noise, planes": Icp(noise=SensorNoise(), estimation=_PLANES),
    "robust": Icp(robust=RobustWeights(loss="tukey")),
    "normals": Icp(max_normal_angle=math.radians(60.0)),
    "trimmed": Icp(rejection=TrimmedRejection(inlier_ratio=0.8)),
    "no rejection": Icp(rejection=None, max_correspondence_distance=1.0),
    "paper": Icp.madhavan2003(),
}


@pytest.mark.parametrize("variant", _VARIANTS)
def test_a_known_pose_is_recovered(variant):
    solution = _aligned(_VARIANTS[variant])
    assert solution.reason is StopReason.STEP_SMALL
    # Two samples of one scene, half a metre apart.
    assert solution.pose.is_close(_MOTION, translation=0.05, rotation=2e-3)


@pytest.mark.parametrize("noise", [None, SensorNoise()], ids=["plain", "noise"])
@pytest.mark.parametrize("estimation", _ESTIMATIONS.values(), ids=_ESTIMATIONS)
def test_the_pose_of_equal_samples_is_recovered_exactly(estimation, noise):
    method = Icp(voxel_size=None, noise=noise, estimation=estimation)
    target = _scan(street(1, 3000), method)
    source = _scan(_MOTION.inverse().apply(street(1, 3000)), method)
    solution = method.align(target, source, Pose.identity())
    assert solution.reason is StopReason.STEP_SMALL
    assert solution.pose.is_close(_MOTION, translation=1e-9, rotation=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("variant", ["svd", "quaternion", "gauss-newton", "tessellation"])
def test_search_and_algorithm_do_not_change_the_pose(variant):
    # A fixed threshold: the mean of an adaptive one rounds differently.
    method = replace(_VARIANTS[variant], rejection=FixedRejection())
    expected = _aligned(Icp(rejection=FixedRejection()), count=3000).pose
    found = _aligned(method, count=3000).pose
    assert found.is_close(expected, translation=1e-6, rotation=1e-7)


def test_the_identity_is_a_fixed_point_of_equal_scans():
    method = Icp()
    scan = _scan(street(1, 2000), method)
    solution = method.align(scan, scan, Pose.identity())
    assert solution.pose.is_close(Pose.identity(), translation=1e-9, rotation=1e-9)
    assert solution.history[0].mean_distance == 0.0
    assert solution.history[0].pairs == len(scan.points)


def test_prepare_downsamples_a_scan_to_the_means_of_its_voxels():
    points, log = street(1, 2000), PreparationLog()
    scan = Icp(voxel_size=1.5).prepare(PointCloud.from_array(points), log)
    means = voxel_means(points, 1.5)
    np.testing.assert_array_equal(np.sort(scan.points, axis=0), np.sort(means, axis=0))
    assert isinstance(scan.closest, PointTree)
    assert scan.spacing == typical_spacing(scan.closest)
    assert log.notes == [f"{len(means)} points with a spacing of {scan.spacing:.3g} m"]
    assert len(_scan(points, Icp(voxel_size=None)).points) == len(points)


def test_prepare_raises_for_fewer_than_ten_points():
    with pytest.raises(InsufficientData, match="has 9 points; 10 are needed"):
        _scan(10.0 * np.arange(27.0).reshape(9, 3), Icp())


def test_prepare_computes_only_data_that_the_settings_need():
    cloud = PointCloud.from_array(street(1, 2000))
    log, annealed_log = PreparationLog(), PreparationLog()
    plain = Icp().prepare(cloud, log)
    assert (len(plain.normals), len(plain.covariances), len(plain.sample)) == (0, 0, 0)
    assert set(log.seconds) == {"downsample", "search", "surface"}
    for method in (Icp(estimation=_PLANES, neighbours=7), Icp(max_normal_angle=1.0)):
        scan = method.prepare(cloud)
        assert isinstance(scan.closest, PointTree)
        expected = surface_normals(scan.closest, method.neighbours)
        np.testing.assert_array_equal(scan.normals, expected)
        assert len(scan.normals) == len(scan.points)
    noise = SensorNoise(range_deviation=0.05)
    noisy = Icp(noise=noise).prepare(cloud)
    np.testing.assert_array_equal(noisy.covariances, noise.covariances(noisy.points))
    annealed = Icp(annealing=AnnealedStart(sample_size=90)).prepare(cloud, annealed_log)
    assert len(annealed.sample) == 90
    assert set(annealed_log.seconds) == {"downsample", "search", "surface", "sample"}
    for array in (noisy.covariances, annealed.sample, annealed.points):
        assert not array.flags.writeable
    assert isinstance(Icp(search="delaunay").prepare(cloud).closest, Tessellation)


def _notes(points, method):
    log = PreparationLog()
    method.prepare(PointCloud.from_array(points), log)
    return log.notes


def test_a_note_warns_of_noise_relative_to_a_wrong_origin():
    note = "sensor noise is relative to the origin, which may not be the sensor"
    on_a_map = street(1, 500) + np.array([5e5, 5e6, 100.0])
    assert note in _notes(on_a_map, Icp(noise=SensorNoise()))
    assert note not in _notes(on_a_map, Icp())
    assert note not in _notes(street(1, 500), Icp(noise=SensorNoise()))


@pytest.mark.parametrize("count", [9, 10])
def test_fewer_than_ten_correspondences_are_an_empty_objective(count):
    source = np.concatenate([_LATTICE[::3][:count] + 0.1, 100.0 * _LATTICE])
    method = Icp(rejection=FixedRejection())
    start = yaw_pose(0.001, (0.1, 0.0, 0.0))
    solution = method.align(point_scan(_LATTICE), point_scan(source), start)
    assert solution.history[0].pairs == count
    assert (solution.reason is StopReason.EMPTY_OBJECTIVE) == (count < 10)
    assert (solution.pose == start) == (count < 10)


@pytest.mark.parametrize(
    "method", [Icp(), Icp(annealing=AnnealedStart())], ids=["plain", "annealed"]
)
def test_without_correspondences_the_start_is_returned(method):
    start = yaw_pose(0.3, (300.0, 0.0, 0.0))
    scan = _scan(street(1, 2000), method)
    solution = method.align(scan, scan, start)
    assert solution.reason is StopReason.EMPTY_OBJECTIVE
    assert solution.pose == start
    (only,) = solution.history
    assert (only.pose, only.pairs, only.accepted) == (start, 0, False)
    assert math.isnan(only.mean_distance)
    assert not solution.quadratic.hessian.any()


def test_the_start_is_returned_if_later_iterations_lose_the_correspondences():
    method = Icp(rejection=RecordingRejection(thresholds=(2.0, 2.0, 1e-9)))
    start = yaw_pose(0.01, (0.1, 0.0, 0.0))
    solution = _aligned(method, start=start, count=2000)
    assert solution.reason is StopReason.EMPTY_OBJECTIVE
    assert solution.pose == start
    assert [one.accepted for one in solution.history] == [True, True, False]
    assert solution.history[1].pose != start
    assert solution.history[-1].pairs < 10


def test_the_start_is_returned_if_no_annealed_start_has_correspondences():
    search = AnnealedStart(annealing=Annealing(steps=50, chains=1))
    method = Icp(max_correspondence_distance=1e-6, annealing=search)
    start = yaw_pose(0.1, (1.0, 0.0, 0.0))
    solution = _aligned(method, start=start, count=2000)
    assert solution.reason is StopReason.EMPTY_OBJECTIVE
    assert solution.pose == start


def test_the_history_has_the_correspondences_of_each_iteration():
    method = Icp(rejection=FixedRejection(max_correspondence_distance=0.8))
    start = yaw_pose(0.01, (0.1, 0.0, 0.0))
    sides = _sides(method, count=3000)
    solution = method.align(*sides, start)
    assert solution.history[0].pose == start
    assert solution.history[-1].pose == solution.pose
    assert solution.history[-1].value == solution.quadratic.value
    assert all(one.accepted for one in solution.history)
    for before, one in itertools.pairwise((None, *solution.history)):
        pairs = method.correspondences(*sides, one.pose)
        assert (one.pairs, one.mean_distance) == (len(pairs), pairs.mean_distance)
        moved = (0.0, 0.0) if before is None else one.pose.distance(before.pose)
        assert one.step_norm == pytest.approx(math.hypot(moved[0], 20.0 * moved[1]))
        differences = (
            one.pose.apply(sides[1].points)[pairs.source_rows] - sides[0].points[pairs.target_rows]
        )
        value = 0.5 * np.mean((differences**2).sum(axis=1)) / 0.1**2
        assert one.value == pytest.approx(value, rel=1e-9)
    ratio = solution.history[-1].pairs / len(sides[1].points)
    assert solution.notes == (
        "stopped because the pose no longer changed",
        f"{solution.history[-1].pairs} correspondences, {ratio:.0%} of the source",
    )


def test_the_note_of_the_rejection_comes_first():
    method = Icp(rejection=RecordingRejection(thresholds=(1.0,)))
    sides = _sides(method, count=2000)
    notes = method.align(*sides, Pose.identity()).notes
    assert notes[0] == f"recorded at {sides[0].spacing:g} m"


def test_a_small_mean_distance_stops_early():
    full = _aligned(Icp(), count=3000)
    between = 0.5 * (full.history[1].mean_distance + full.history[2].mean_distance)
    near = _aligned(Icp(criteria=IcpConvergenceCriteria(mean_distance=between)), count=3000)
    assert near.reason is StopReason.STEP_SMALL
    assert len(near.history) == 3 < len(full.history)
    assert near.pose == full.history[2].pose
    assert any(str(note).startswith("stopped at a mean distance") for note in near.notes)


def test_the_iteration_limit_is_reported():
    full = _aligned(Icp(), count=3000)
    stopped = _aligned(Icp(criteria=IcpConvergenceCriteria(max_iterations=3)), count=3000)
    assert stopped.reason is StopReason.ITERATION_LIMIT
    assert len(stopped.history) == 3
    assert stopped.pose == full.history[2].pose
    assert "stopped after 3 iterations" in stopped.notes


def test_the_rejection_gets_previous_thresholds_after_a_small_step():
    thresholds = tuple(3.0 - 0.1 * k for k in range(15))
    rejection = RecordingRejection(thresholds=thresholds)
    method = Icp(
        rejection=rejection,
        statistics_switch_step=0.05,
        criteria=IcpConvergenceCriteria(max_iterations=15),
    )
    steps = [one.step_norm for one in _aligned(method, count=3000).history]
    switch = next(k for k, step in enumerate(steps) if k and step < 0.05)
    assert 2 < switch < len(steps) - 2
    previous = rejection.previous
    assert previous[:switch] == [math.inf] * switch
    assert previous[switch:] == list(thresholds[switch - 1 : len(previous) - 1])


def test_an_infinite_switch_step_uses_thresholds_from_the_second_iteration_on():
    rejection = RecordingRejection(thresholds=(9.0, 8.0, 7.0, 6.0))
    criteria = IcpConvergenceCriteria(max_iterations=4)
    method = Icp(
        rejection=rejection,
        statistics_switch_step=math.inf,
        criteria=criteria,
    )
    _aligned(method, count=2000)
    assert rejection.previous == [math.inf, 9.0, 8.0, 7.0]


def test_the_settings_of_the_paper():
    method = Icp.madhavan2003()
    assert method.search == "delaunay"
    assert method.voxel_size is None
    assert method.noise is None
    assert method.annealing is None
    assert method.rejection == AdaptiveRejection(statistics="all")
    assert method.max_correspondence_distance == math.inf
    assert method.max_normal_angle is None
    assert method.robust == RobustWeights()
    assert method.estimation == TransformEstimation(algorithm="svd", residual="point-to-point")
    assert (method.criteria.relative_change, method.criteria.mean_distance) == (0.01, None)
    rejection = Icp.madhavan2003(good_distance=0.4).rejection
    assert rejection == AdaptiveRejection(good_distance=0.4, statistics="all")


def test_the_paper_stops_at_a_small_relative_change():
    solution = _aligned(Icp.madhavan2003(), count=2000)
    before, last = (one.pose for one in solution.history[-2:])
    metres, radians = last.distance(before)
    distance, angle = last.distance(Pose.identity())
    assert metres <= 0.01 * distance
    assert radians <= 0.01 * angle
    assert metres > 1e-6
    assert any("changed by a ratio of at most 0.01" in str(note) for note in solution.notes)


@pytest.mark.parametrize("estimation", [TransformEstimation(), _PLANES], ids=["points", "planes"])
def test_locked_directions_keep_their_initial_values(estimation):
    start = Pose.from_step(np.array([0.1, 0.0, 0.25, 0.02, -0.01, 0.0]))
    locked = Constraints(dof="xy+yaw")
    solution = _aligned(Icp(estimation=estimation), start=start, constraints=locked)
    assert solution.reason.is_converged
    assert solution.pose.translation[2] == pytest.approx(start.translation[2], abs=1e-9)
    tilt = solution.pose.rotation @ start.rotation.T
    np.testing.assert_allclose(tilt[2], [0.0, 0.0, 1.0], atol=1e-9)
    assert solution.pose.distance(start)[0] > 0.2


def test_a_precise_prior_determines_the_pose_and_is_noted():
    mean = yaw_pose(0.08, (0.8, 0.0, 0.0))
    precise = Constraints(prior=PosePrior.from_deviations(mean, 1e-5, 1e-6))
    imprecise = Constraints(prior=PosePrior.from_deviations(mean, 100.0, 10.0))
    bound, free = (_aligned(Icp(), constraints=one, count=3000) for one in (precise, imprecise))
    assert bound.pose.is_close(mean, translation=1e-3, rotation=1e-4)
    assert free.pose.is_close(_aligned(Icp(), count=3000).pose, translation=1e-3, rotation=1e-4)
    for solution in (bound, free):
        notes = [note for note in solution.notes if "prior" in str(note)]
        assert notes == ["closed forms cannot include a prior: Gauss-Newton steps instead"]


def test_scans_of_a_line_are_aligned_and_noted():
    line = np.arange(-10.0, 10.0, 0.5)[:, None] * [1.0, 0.0, 0.0]
    method = Icp(voxel_size=None, rejection=FixedRejection())
    target = _scan(line, method)
    source = _scan(yaw_pose(0.02, (0.05, 0.3, 0.1)).inverse().apply(line), method)
    solution = method.align(target, source, Pose.identity())
    assert solution.reason.is_converged
    _, distances = target.closest.nearest(solution.pose.apply(source.points))
    np.testing.assert_allclose(distances, 0.0, atol=1e-6)
    assert sum("on a line" in str(note) for note in solution.notes) == 1


@pytest.mark.parametrize("algorithm", ["svd", "quaternion", "gauss-newton"])
def test_correspondences_of_zero_weight_are_an_empty_objective(algorithm):
    method = Icp(
        robust=RobustWeights(loss="tukey", scale=0.001),
        estimation=TransformEstimation(algorithm=algorithm),
    )
    start = yaw_pose(0.1, (1.0, 0.0, 0.3))
    solution = _aligned(method, start=start, count=2000)
    assert solution.reason is StopReason.EMPTY_OBJECTIVE
    assert solution.pose == start


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"search": "octree"}, "search must be 'k-d tree' or 'delaunay', got 'octree'"),
        *(
            ({name: value}, f"{name} must be positive, got {value} m")
            for name in ("statistics_switch_step", "max_correspondence_distance")
            for value in (0.0, -math.inf, math.nan)
        ),
        ({"max_normal_angle": 0.0}, "max_normal_angle must lie above 0 .* pi/2, got 0.0 rad"),
        ({"max_normal_angle": 1.6}, "max_normal_angle must lie above 0 .* pi/2, got 1.6 rad"),
        ({"max_normal_angle": math.nan}, "max_normal_angle must lie above 0 .* pi/2, got nan rad"),
        ({"voxel_size": 0.0}, "voxel_size must be positive, got 0.0 m"),
        ({"voxel_size": math.inf}, "voxel_size must be positive, got inf m"),
        ({"neighbours": 3}, "neighbours must be a whole number of at least 4, got 3"),
        ({"neighbours": 5.0}, "neighbours must be a whole number of at least 4, got 5.0"),
    ],
)
def test_invalid_settings_raise(settings, message):
    with pytest.raises(InvalidInput, match=message):
        Icp(**settings)
