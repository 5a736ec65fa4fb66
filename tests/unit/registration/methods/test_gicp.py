import math

import numpy as np
import pytest

from reference.samples import street, yaw_pose
from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.optimisation.objectives.constraints import Constraints, PosePrior
from scanlock.optimisation.solvers.bfgs import Bfgs
from scanlock.optimisation.solvers.criteria import ConvergenceCriteria, StopReason
from scanlock.optimisation.solvers.newton import Newton
from scanlock.registration.methods.gicp import Gicp
from scanlock.registration.register import register

_with_each_meeting = pytest.mark.parametrize("meeting", ["closest", "voxel"])


def _scan(points, method):
    return method.prepare(PointCloud.from_array(points))


def _aligned(method, motion, start=None, constraints=None):
    target, source = _scan(street(1), method), _scan(motion.inverse().apply(street(2)), method)
    return method.align(target, source, start or Pose.identity(), constraints or Constraints())


@_with_each_meeting
@pytest.mark.parametrize(
    "motion",
    [
        yaw_pose(0.02, (0.3, -0.2, 0.05)),
        yaw_pose(0.2, (2.0, -1.0, 0.1)),
        Pose.from_step(np.array([0.2, -0.4, 0.1, 0.05, -0.03, 0.1])),
    ],
)
def test_a_known_motion_is_recovered(meeting, motion):
    solution = _aligned(Gicp(search=meeting), motion)
    assert solution.reason is StopReason.STEP_SMALL
    # Noise of 2 cm over thousands of points; voxels of 1 m round off edges.
    assert solution.pose.is_close(motion, translation=0.03, rotation=2e-3)


@pytest.mark.parametrize(
    "solver", [Newton(), Bfgs(), Newton(criteria=ConvergenceCriteria(max_iterations=2))]
)
def test_the_solver_does_not_change_where_the_pairing_ends(solver):
    motion = yaw_pose(0.1, (1.0, -0.5, 0.1))
    poses = [_aligned(Gicp(), motion).pose, _aligned(Gicp(solver=solver), motion).pose]
    assert poses[0].is_close(poses[1], translation=2e-3, rotation=1e-4)


def test_a_wide_gate_reaches_farther_and_a_narrow_one_sees_sharper():
    motion = yaw_pose(0.2, (2.0, -1.0, 0.1))
    # Half of what the source saw is missing: a wide gate pairs it all the same.
    target = street(1)[street(1)[:, 0] > 0.0]
    source = motion.inverse().apply(street(2))
    errors = []
    for gates in ((20.0,), (1.0,), (20.0, 5.0, 1.0)):
        method = Gicp(max_correspondence_distances=gates)
        solution = method.align(_scan(target, method), _scan(source, method), Pose.identity())
        errors.append(solution.pose.distance(motion)[0])
    wide, narrow, both = errors
    assert both < 0.01 < 0.03 < wide < 1.0 < narrow


def test_each_scale_starts_from_the_pose_of_the_last():
    motion = yaw_pose(0.1, (1.0, 0.0, 0.0))
    coarse = _aligned(
        Gicp(max_correspondence_distances=(8.0,), step_tolerance=8.0 * 0.0025), motion
    )
    fine = _aligned(Gicp(max_correspondence_distances=(1.0,)), motion, start=coarse.pose)
    both = _aligned(Gicp(max_correspondence_distances=(8.0, 1.0)), motion)
    assert both.pose == fine.pose
    assert len(both.history) == len(coarse.history) + len(fine.history)


def test_the_history_counts_pairs_and_begins_at_the_start():
    start = yaw_pose(0.01, (0.1, 0.0, 0.0))
    solution = _aligned(Gicp(), yaw_pose(0.02, (0.3, -0.2, 0.05)), start=start)
    assert solution.history[0].pose == start
    gaps = [one.mean_distance for one in solution.history if not math.isnan(one.mean_distance)]
    assert gaps[-1] < gaps[0] < 1.0
    pairs = [one.pairs for one in solution.history]
    assert all(count > 1000 for count in pairs)
    # A gate of a metre leaves out what one of twenty lets meet.
    assert pairs[-1] < pairs[0]
    assert solution.notes == (
        f"{pairs[-1]} pairs, {pairs[-1] / _thinned_count():.0%} of the source",
    )


def _thinned_count():
    motion = yaw_pose(0.02, (0.3, -0.2, 0.05))
    return len(_scan(motion.inverse().apply(street(2)), Gicp()).surface)


@_with_each_meeting
def test_where_nothing_meets_the_start_is_returned(meeting):
    method, start = Gicp(search=meeting), yaw_pose(0.3, (300.0, 0.0, 0.0))
    scan = _scan(street(1), method)
    solution = method.align(scan, scan, start)
    assert solution.reason is StopReason.EMPTY_OBJECTIVE
    assert solution.pose == start
    assert solution.history[0].pose == start
    assert solution.history[0].pairs == 0


def test_a_start_lost_at_the_last_scale_is_returned_untouched():
    # The scans meet at 20 m but, after the best that 20 m can do, not at a centimetre.
    method = Gicp(max_correspondence_distances=(20.0, 0.0001))
    start = Pose.from_step(np.array([2.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    solution = method.align(_scan(street(1), method), _scan(street(2), method), start)
    assert solution.reason is StopReason.EMPTY_OBJECTIVE
    assert solution.pose == start
    assert len(solution.history) > 2


def test_too_few_rounds_are_said_to_be():
    solution = _aligned(Gicp(max_iterations=1), yaw_pose(0.3, (3.0, 2.0, 0.0)))
    assert solution.reason is StopReason.ITERATION_LIMIT


@_with_each_meeting
def test_locked_directions_stay(meeting):
    start = Pose.from_step(np.array([0.1, 0.0, 0.25, 0.02, -0.01, 0.0]))
    motion = yaw_pose(0.1, (1.0, -0.5, 0.2))
    solution = _aligned(Gicp(search=meeting), motion, start, Constraints(dof="xy+yaw"))
    assert solution.pose.translation[2] == pytest.approx(start.translation[2], abs=1e-9)
    tilt = solution.pose.rotation @ start.rotation.T
    np.testing.assert_allclose(tilt[2], [0.0, 0.0, 1.0], atol=1e-9)
    assert solution.pose.distance(motion)[0] < 0.2


def test_a_firm_prior_holds_the_pose():
    motion, belief = yaw_pose(0.02, (0.3, -0.2, 0.05)), yaw_pose(0.05, (0.6, 0.0, 0.0))
    firm = Constraints(prior=PosePrior.from_deviations(belief, 1e-5, 1e-6))
    loose = Constraints(prior=PosePrior.from_deviations(belief, 100.0, 10.0))
    held, free = (_aligned(Gicp(), motion, constraints=one).pose for one in (firm, loose))
    assert held.is_close(belief, translation=1e-3, rotation=1e-4)
    assert free.is_close(_aligned(Gicp(), motion).pose, translation=1e-4, rotation=1e-5)


def test_a_scan_keeps_what_it_was_thinned_to():
    kept = _scan(street(1), Gicp(voxel_size=0.5))
    assert len(kept.surface) < 4000 < len(kept.cloud)
    assert kept.surface.points is kept.tree.points
    assert kept.voxels == ()
    assert kept.insufficient == ""
    assert kept.notes == (f"{len(kept.surface)} surface points; 0 others stand alone",)
    assert set(kept.timings) == {"thin", "surface", "voxels"}
    widths = [voxels.size for voxels in _scan(street(1), Gicp(search="voxel")).voxels]
    assert widths == [8.0, 4.0, 2.0, 1.0]


def test_points_that_stand_alone_are_left_out():
    strays = [[1e6, 1e6, 0.0], [0.0, 0.0, 4e3], [-500.0, 0.0, 0.0]]
    kept = _scan(np.vstack([street(1), strays]), Gicp())
    plain = _scan(street(1), Gicp())
    assert kept.left_out == plain.left_out + 3
    np.testing.assert_array_equal(
        np.sort(kept.surface.points, axis=0), np.sort(plain.surface.points, axis=0)
    )
    # Where every point stands alone, that is how dense the scan is.
    sparse = _scan(1000.0 * street(1)[:500], Gicp())
    assert (len(sparse.surface), sparse.left_out) == (500, 0)


def _corridor(seed, count=6000):
    rng = np.random.default_rng(seed)
    along, height = rng.uniform(-40.0, 40.0, count), rng.uniform(0.0, 3.0, count)
    across = rng.choice([-2.0, 2.0], count)
    return np.column_stack([along, across, height - 1.5]) + rng.normal(0.0, 0.02, (count, 3))


def test_coarse_scales_are_not_followed_away_from_a_good_start():
    # A voxel as wide as the corridor holds both of its walls, and its mean lies between them.
    method = Gicp(search="voxel", target_voxel_sizes=(16.0, 1.0))
    target, source = _scan(_corridor(1), method), _scan(_corridor(2), method)
    led = method.align(target, source, Pose.identity())
    assert any("not followed" in note for note in led.notes)
    # Bare walls leave open the way along them and up.
    assert abs(led.pose.translation[1]) < 0.01
    assert led.pose.distance(Pose.identity())[1] < 0.01
    good = _aligned(Gicp(search="voxel"), yaw_pose(0.1, (1.0, -0.5, 0.1)))
    assert not any("not followed" in note for note in good.notes)


@_with_each_meeting
@pytest.mark.parametrize("count", [1, 3, 9])
def test_a_handful_of_points_is_too_few(meeting, count):
    handful = np.random.default_rng(0).uniform(-5.0, 5.0, (count, 3))
    assert _scan(handful, Gicp(search=meeting)).insufficient == (
        f"holds {count} surface points, of 10 needed"
    )


@_with_each_meeting
def test_the_front_door_takes_it(meeting):
    motion = yaw_pose(0.2, (2.0, -1.0, 0.1))
    result = register(
        source=motion.inverse().apply(street(2)), target=street(1), method=Gicp(search=meeting)
    )
    assert result.ok, result.reason
    assert result.target_from_source.is_close(motion, translation=0.03, rotation=2e-3)
    assert result.method == "Gicp"


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"meeting": "nearest"}, "meeting must be 'closest' or 'voxel', got 'nearest'"),
        ({"gates": ()}, r"gates must not grow from scale to scale, got \(\)"),
        ({"gates": (1.0, 2.0)}, "gates must not grow"),
        ({"gates": (1.0, -1.0)}, "gates must be positive, got -1.0 m"),
        ({"voxel_widths": (1.0, 4.0)}, "voxel_widths must not grow"),
        ({"spacing": 0.0}, "spacing must be positive"),
        ({"neighbours": 3}, "neighbours must be a whole number of at least 4"),
        ({"shape": "sphere"}, "shape must be"),
        ({"covariance_epsilon": 0.0}, "covariance_epsilon must be positive"),
        ({"tolerance": 0.0}, "tolerance must be positive"),
        ({"rounds": 0}, "rounds must be a whole number"),
        ({"lever": 0.0}, "lever must be positive"),
    ],
)
def test_settings_out_of_range_are_refused(settings, message):
    with pytest.raises(InvalidInput, match=message):
        Gicp(**settings)
