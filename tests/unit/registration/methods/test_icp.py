import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from reference.point_scans import SpyingGate, point_scan
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
from scanlock.registration.methods.correspondences import CorrespondenceFinder, typical_spacing
from scanlock.registration.methods.icp import Icp
from scanlock.registration.methods.icp_annealing import AnnealedStart
from scanlock.registration.methods.icp_history import IcpConvergenceCriteria
from scanlock.registration.methods.rejection import (
    AdaptiveRejection,
    FixedRejection,
    TrimmedRejection,
)
from scanlock.registration.methods.transform_estimation import TransformEstimation

_MOTION = yaw_pose(0.05, (0.5, -0.3, 0.1))
_PLANES = TransformEstimation(algorithm="gauss-newton", residual="point-to-plane")
_FITS = {
    step: TransformEstimation(algorithm=step) for step in ("svd", "quaternion", "gauss-newton")
}
_FITS["planes"] = _PLANES
_LATTICE = 10.0 * np.array(list(itertools.product(range(4), repeat=3)), np.float64) - 15.0
"""Points too far apart for a pair to change sides."""


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
    "robust": Icp(correspondences=CorrespondenceFinder(robust=RobustWeights(loss="tukey"))),
    "orientation": Icp(correspondences=CorrespondenceFinder(max_normal_angle=math.radians(60.0))),
    "trimmed": Icp(
        correspondences=CorrespondenceFinder(rejection=TrimmedRejection(inlier_ratio=0.8))
    ),
    "paper": Icp.madhavan2003(),
}


@pytest.mark.parametrize("variant", _VARIANTS)
def test_a_known_motion_is_recovered(variant):
    solution = _aligned(_VARIANTS[variant])
    assert solution.reason is StopReason.STEP_SMALL
    # Two looks at one world sample it half a metre apart.
    assert solution.pose.is_close(_MOTION, translation=0.05, rotation=2e-3)


@pytest.mark.parametrize("noise", [None, SensorNoise()], ids=["plain", "noise"])
@pytest.mark.parametrize("fit", _FITS.values(), ids=_FITS)
def test_the_motion_of_one_look_is_recovered_exactly(fit, noise):
    # Of two looks, Gauss and Newton under noise hold what is a metre from the sensor to within
    # millimetres, though no two points there are samples of one place.
    method = Icp(voxel_size=None, noise=noise, estimation=fit)
    target = _scan(street(1, 3000), method)
    source = _scan(_MOTION.inverse().apply(street(1, 3000)), method)
    solution = method.align(target, source, Pose.identity())
    assert solution.reason is StopReason.STEP_SMALL
    assert solution.pose.is_close(_MOTION, translation=1e-9, rotation=1e-10)


@pytest.mark.parametrize("variant", ["svd", "quaternion", "gauss-newton", "tessellation"])
def test_search_and_step_do_not_change_the_answer(variant):
    # A fixed gate: the mean of an adaptive one rounds differently.
    method = replace(_VARIANTS[variant], pairing=CorrespondenceFinder(rejection=FixedRejection()))
    expected = _aligned(
        Icp(correspondences=CorrespondenceFinder(rejection=FixedRejection())), count=3000
    ).pose
    found = _aligned(method, count=3000).pose
    assert found.is_close(expected, translation=1e-6, rotation=1e-7)


def test_a_scan_to_itself_stays():
    method = Icp()
    scan = _scan(street(1, 2000), method)
    solution = method.align(scan, scan, Pose.identity())
    assert solution.pose.is_close(Pose.identity(), translation=1e-9, rotation=1e-9)
    assert solution.history[0].mean_distance == 0.0
    assert solution.history[0].pairs == len(scan.points)


def test_a_scan_is_thinned_to_the_means_of_its_voxels():
    points = street(1, 2000)
    kept = _scan(points, Icp(voxel_size=1.5))
    means = voxel_means(points, 1.5)
    np.testing.assert_array_equal(np.sort(kept.points, axis=0), np.sort(means, axis=0))
    assert isinstance(kept.closest, PointTree)
    assert kept.spacing == typical_spacing(kept.closest)
    assert kept.notes == (f"{len(means)} points to pair, {kept.spacing:.3g} m apart",)
    assert kept.insufficient == ""
    assert len(_scan(points, Icp(voxel_size=None)).points) == len(points)


def test_only_what_the_settings_need_is_kept():
    cloud = PointCloud.from_array(street(1, 2000))
    plain = Icp().prepare(cloud)
    assert (len(plain.normals), len(plain.covariances), len(plain.sample)) == (0, 0, 0)
    assert set(plain.timings) == {"thin", "search", "surface"}
    for method in (
        Icp(estimation=_PLANES, neighbours=7),
        Icp(correspondences=CorrespondenceFinder(max_normal_angle=1.0)),
    ):
        kept = method.prepare(cloud)
        assert isinstance(kept.closest, PointTree)
        expected = surface_normals(kept.closest, method.neighbours)
        np.testing.assert_array_equal(kept.normals, expected)
        assert len(kept.normals) == len(kept.points)
    noise = SensorNoise(range_deviation=0.05)
    noisy = Icp(noise=noise).prepare(cloud)
    np.testing.assert_array_equal(noisy.covariances, noise.covariances(noisy.points))
    searched = Icp(annealing=AnnealedStart(sample_size=90)).prepare(cloud)
    assert len(searched.sample) == 90
    assert set(searched.timings) == {"thin", "search", "surface", "sample"}
    for array in (noisy.covariances, searched.sample, searched.points):
        assert not array.flags.writeable
    assert isinstance(Icp(search="delaunay").prepare(cloud).closest, Tessellation)


def test_noise_about_a_sensor_that_may_be_elsewhere_is_said():
    note = "sensor noise taken about the origin, where the sensor may not be"
    on_a_map = street(1, 500) + np.array([5e5, 5e6, 100.0])
    assert note in _scan(on_a_map, Icp(noise=SensorNoise())).notes
    assert note not in _scan(on_a_map, Icp()).notes
    assert note not in _scan(street(1, 500), Icp(noise=SensorNoise())).notes


@pytest.mark.parametrize("count", [9, 10])
def test_fewer_than_ten_meeting_points_are_no_support(count):
    source = np.concatenate([_LATTICE[::3][:count] + 0.1, 100.0 * _LATTICE])
    method = Icp(correspondences=CorrespondenceFinder(rejection=FixedRejection()))
    start = yaw_pose(0.001, (0.1, 0.0, 0.0))
    solution = method.align(point_scan(_LATTICE), point_scan(source), start)
    assert solution.history[0].pairs == count
    assert (solution.reason is StopReason.EMPTY_OBJECTIVE) == (count < 10)
    assert (solution.pose == start) == (count < 10)


@pytest.mark.parametrize("method", [Icp(), Icp(annealing=AnnealedStart())], ids=["plain", "found"])
def test_where_nothing_meets_the_start_is_returned_untouched(method):
    start = yaw_pose(0.3, (300.0, 0.0, 0.0))
    scan = _scan(street(1, 2000), method)
    solution = method.align(scan, scan, start)
    assert solution.reason is StopReason.EMPTY_OBJECTIVE
    assert solution.pose == start
    (only,) = solution.history
    assert (only.pose, only.pairs, only.accepted) == (start, 0, False)
    assert math.isnan(only.mean_distance)
    assert not solution.quadratic.hessian.any()


def test_a_start_whose_pairs_are_lost_on_the_way_is_returned_untouched():
    gate = SpyingGate(limits=(2.0, 2.0, 1e-9))
    method = Icp(correspondences=CorrespondenceFinder(rejection=gate))
    start = yaw_pose(0.01, (0.1, 0.0, 0.0))
    solution = _aligned(method, start=start, count=2000)
    assert solution.reason is StopReason.EMPTY_OBJECTIVE
    assert solution.pose == start
    assert [one.accepted for one in solution.history] == [True, True, False]
    assert solution.history[1].pose != start
    assert solution.history[-1].pairs < 10


def test_no_start_of_the_search_has_support_either():
    # Searched for but within reach of nothing: the first start is what comes back.
    search = AnnealedStart(annealing=Annealing(steps=50, chains=1))
    method = Icp(
        correspondences=CorrespondenceFinder(max_correspondence_distance=1e-6), annealing=search
    )
    start = yaw_pose(0.1, (1.0, 0.0, 0.0))
    solution = _aligned(method, start=start, count=2000)
    assert solution.reason is StopReason.EMPTY_OBJECTIVE
    assert solution.pose == start


def test_the_history_tells_each_pairing():
    pairing = CorrespondenceFinder(rejection=FixedRejection(max_correspondence_distance=0.8))
    method, start = Icp(correspondences=pairing), yaw_pose(0.01, (0.1, 0.0, 0.0))
    sides = _sides(method, count=3000)
    solution = method.align(*sides, start)
    assert solution.history[0].pose == start
    assert solution.history[-1].pose == solution.pose
    assert solution.history[-1].value == solution.quadratic.value
    assert all(one.accepted for one in solution.history)
    for before, one in itertools.pairwise((None, *solution.history)):
        pairs = pairing.find(*sides, one.pose, math.inf, math.inf, "point-to-point")
        assert (one.pairs, one.mean_distance) == (len(pairs), pairs.mean_distance)
        moved = (0.0, 0.0) if before is None else one.pose.distance(before.pose)
        assert one.step_norm == pytest.approx(math.hypot(moved[0], 20.0 * moved[1]))
        gaps = (
            one.pose.apply(sides[1].points)[pairs.source_rows] - sides[0].points[pairs.target_rows]
        )
        value = 0.5 * np.mean((gaps**2).sum(axis=1)) / 0.1**2
        assert one.value == pytest.approx(value, rel=1e-9)
    share = solution.history[-1].pairs / len(sides[1].points)
    assert solution.notes == (
        "stopped because the pose changed no more",
        f"{solution.history[-1].pairs} pairs, {share:.0%} of the source",
    )


def test_what_the_gate_inferred_is_noted():
    method = Icp(correspondences=CorrespondenceFinder(rejection=SpyingGate(limits=(1.0,))))
    sides = _sides(method, count=2000)
    notes = method.align(*sides, Pose.identity()).notes
    assert notes[0] == f"spied at {sides[0].spacing:g} m"


def test_near_enough_stops_it_early():
    full = _aligned(Icp(), count=3000)
    between = 0.5 * (full.history[1].mean_distance + full.history[2].mean_distance)
    near = _aligned(Icp(criteria=IcpConvergenceCriteria(mean_distance=between)), count=3000)
    assert near.reason is StopReason.STEP_SMALL
    assert len(near.history) == 3 < len(full.history)
    assert near.pose == full.history[2].pose
    assert any(note.startswith("stopped at a mean pair distance") for note in near.notes)


def test_too_few_iterations_are_said_to_be():
    full = _aligned(Icp(), count=3000)
    cut = _aligned(Icp(criteria=IcpConvergenceCriteria(max_iterations=3)), count=3000)
    assert cut.reason is StopReason.ITERATION_LIMIT
    assert len(cut.history) == 3
    assert cut.pose == full.history[2].pose
    assert "stopped after 3 iterations" in cut.notes


def test_an_adaptive_gate_heeds_its_limit_once_the_pose_settles():
    limits = tuple(3.0 - 0.1 * k for k in range(15))
    gate = SpyingGate(limits=limits)
    method = Icp(
        correspondences=CorrespondenceFinder(rejection=gate),
        statistics_switch_step=0.05,
        criteria=IcpConvergenceCriteria(max_iterations=15),
    )
    steps = [one.step_norm for one in _aligned(method, count=3000).history]
    settled = next(k for k, step in enumerate(steps) if k and step < 0.05)
    assert 2 < settled < len(steps) - 2
    assert gate.previous[:settled] == [math.inf] * settled
    assert gate.previous[settled:] == list(limits[settled - 1 : len(gate.previous) - 1])


def test_settling_at_once_heeds_limits_from_the_second_iteration():
    gate = SpyingGate(limits=(9.0, 8.0, 7.0, 6.0))
    criteria = IcpConvergenceCriteria(max_iterations=4)
    method = Icp(
        correspondences=CorrespondenceFinder(rejection=gate),
        statistics_switch_step=math.inf,
        criteria=criteria,
    )
    _aligned(method, count=2000)
    assert gate.previous == [math.inf, 9.0, 8.0, 7.0]


def test_the_paper_takes_all_points_a_tessellation_and_statistics_of_all_pairs():
    method = Icp.madhavan2003()
    assert method.search == "delaunay"
    assert method.voxel_size is None
    assert method.noise is None
    assert method.annealing is None
    assert method.correspondences == CorrespondenceFinder(
        rejection=AdaptiveRejection(statistics="all"), max_correspondence_distance=math.inf
    )
    assert method.estimation == TransformEstimation(algorithm="svd", residual="point-to-point")
    assert (method.criteria.relative_change, method.criteria.mean_distance) == (0.01, None)
    gate = Icp.madhavan2003(good_distance=0.4).pairing.gate
    assert isinstance(gate, AdaptiveRejection)
    assert gate.good_distance == 0.4


def test_the_paper_stops_at_a_small_share_of_the_motion():
    solution = _aligned(Icp.madhavan2003(), count=2000)
    before, last = (one.pose for one in solution.history[-2:])
    metres, radians = last.distance(before)
    distance, angle = last.distance(Pose.identity())
    assert metres <= 0.01 * distance
    assert radians <= 0.01 * angle
    assert metres > 1e-6
    assert any("changed by 0.01 of themselves" in note for note in solution.notes)


@pytest.mark.parametrize("fit", [TransformEstimation(), _PLANES], ids=["points", "planes"])
def test_locked_directions_stay(fit):
    start = Pose.from_step(np.array([0.1, 0.0, 0.25, 0.02, -0.01, 0.0]))
    solution = _aligned(Icp(estimation=fit), start=start, constraints=Constraints(dof="xy+yaw"))
    assert solution.reason.is_converged
    assert solution.pose.translation[2] == pytest.approx(start.translation[2], abs=1e-9)
    tilt = solution.pose.rotation @ start.rotation.T
    np.testing.assert_allclose(tilt[2], [0.0, 0.0, 1.0], atol=1e-9)
    assert solution.pose.distance(start)[0] > 0.2


def test_a_firm_prior_holds_the_pose_and_is_said_to():
    belief = yaw_pose(0.08, (0.8, 0.0, 0.0))
    firm = Constraints(prior=PosePrior.from_deviations(belief, 1e-5, 1e-6))
    loose = Constraints(prior=PosePrior.from_deviations(belief, 100.0, 10.0))
    held, free = (_aligned(Icp(), constraints=one, count=3000) for one in (firm, loose))
    assert held.pose.is_close(belief, translation=1e-3, rotation=1e-4)
    assert free.pose.is_close(_aligned(Icp(), count=3000).pose, translation=1e-3, rotation=1e-4)
    for solution in (held, free):
        notes = [note for note in solution.notes if "heeds a prior" in note]
        assert notes == ["no closed form heeds a prior: steps of Gauss and Newton instead"]


def test_scans_of_a_line_are_laid_upon_each_other_and_said_to_be_one():
    line = np.arange(-10.0, 10.0, 0.5)[:, None] * [1.0, 0.0, 0.0]
    method = Icp(voxel_size=None, correspondences=CorrespondenceFinder(rejection=FixedRejection()))
    target = _scan(line, method)
    source = _scan(yaw_pose(0.02, (0.05, 0.3, 0.1)).inverse().apply(line), method)
    solution = method.align(target, source, Pose.identity())
    assert solution.reason.is_converged
    _, gaps = target.closest.nearest(solution.pose.apply(source.points))
    np.testing.assert_allclose(gaps, 0.0, atol=1e-6)
    assert sum("pairs on a line" in note for note in solution.notes) == 1


@pytest.mark.parametrize("step", ["svd", "quaternion", "gauss-newton"])
def test_pairs_without_weight_are_no_support(step):
    robust = RobustWeights(loss="tukey", scale=0.001)
    method = Icp(
        correspondences=CorrespondenceFinder(robust=robust),
        estimation=TransformEstimation(algorithm=step),
    )
    start = yaw_pose(0.1, (1.0, 0.0, 0.3))
    solution = _aligned(method, start=start, count=2000)
    assert solution.reason is StopReason.EMPTY_OBJECTIVE
    assert solution.pose == start


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"search": "octree"}, "search must be 'k-d tree' or 'delaunay', got 'octree'"),
        ({"settling": 0.0}, "settling must be positive, got 0.0 m"),
        ({"settling": -math.inf}, "settling must be positive, got -inf m"),
        ({"settling": math.nan}, "settling must be positive, got nan m"),
        ({"spacing": 0.0}, "spacing must be positive, got 0.0 m"),
        ({"spacing": math.inf}, "spacing must be positive, got inf m"),
        ({"neighbours": 3}, "neighbours must be a whole number of at least 4, got 3"),
        ({"neighbours": 5.0}, "neighbours must be a whole number of at least 4, got 5.0"),
    ],
)
def test_settings_out_of_range_are_refused(settings, message):
    with pytest.raises(InvalidInput, match=message):
        Icp(**settings)


def test_settling_at_once_is_a_setting():
    assert Icp(statistics_switch_step=math.inf).statistics_switch_step == math.inf
