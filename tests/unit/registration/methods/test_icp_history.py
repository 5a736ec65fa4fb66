import math

import numpy as np
import pytest

from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.optimisation.solvers.criteria import StopReason
from scanlock.optimisation.solvers.problem import Quadratic
from scanlock.optimisation.solvers.solution import Iteration
from scanlock.registration.methods.correspondences import Correspondences
from scanlock.registration.methods.icp_history import IcpConvergenceCriteria, IcpHistory

_NEVER = IcpConvergenceCriteria(step_tolerance=1e-300)


def _shift(x, yaw=0.0):
    return Pose.from_step(np.array([x, 0.0, 0.0, 0.0, 0.0, yaw]))


def _pairs(count=3, mean_distance=0.2, limit=1.0):
    rows = np.arange(count)
    return Correspondences(rows, rows, np.ones(count), mean_distance, limit)


def _trail(poses, limits=None, rotation_scale=10.0):
    trail = IcpHistory(rotation_scale)
    for k, pose in enumerate(poses):
        limit = 1.0 if limits is None else limits[k]
        trail.add(Quadratic(0.0, np.zeros(6), np.eye(6)), pose, _pairs(limit=limit))
    return trail


def _history(poses, step_norm=1.0, mean_distance=0.2):
    return [Iteration(0.0, 0.0, step_norm, True, pose, mean_distance, 3) for pose in poses]


def test_an_iteration_is_kept_with_its_step_and_slope():
    trail = _trail([_shift(1.0, 0.1)], rotation_scale=10.0)
    gradient = np.array([3.0, 0.0, 0.0, 0.0, 40.0, 0.0])
    quadratic = Quadratic(0.7, gradient, np.eye(6))
    trail.add(quadratic, _shift(1.3, 0.14), _pairs(8, 0.25), accepted=False)
    first, last = trail.history
    assert (first.step_norm, first.gradient_norm, first.accepted) == (0.0, 0.0, True)
    # 0.3 m and 0.04 rad, the latter at ten metres; 3 per metre and 40 per radian likewise.
    assert last.step_norm == pytest.approx(0.5, rel=1e-9)
    assert last.gradient_norm == pytest.approx(5.0, rel=1e-12)
    assert (last.value, last.accepted, last.pairs, last.mean_distance) == (0.7, False, 8, 0.25)
    assert last.pose == _shift(1.3, 0.14)


@pytest.mark.parametrize("length", range(2, 9))
def test_a_pose_that_came_back_gives_away_its_period(length):
    circle = [_shift(float(k % length)) for k in range(2 * length + 1)]
    for count in range(1, len(circle) + 1):
        found = _trail(circle[:count]).period(1e-6)
        assert found == (length if count > length else 0)


def test_a_pose_that_stays_or_returns_after_long_has_no_period():
    # The last step is not asked: who stays has stopped.
    assert _trail([_shift(0.0), _shift(1.0), _shift(1.0)]).period(1e-6) == 0
    assert _trail([_shift(float(k % 9)) for k in range(10)]).period(1e-6) == 0
    assert _trail([_shift(float(k)) for k in range(30)]).period(1e-6) == 0


def test_the_shortest_period_is_told():
    assert _trail([_shift(float(k % 2)) for k in range(9)]).period(1e-6) == 2


@pytest.mark.parametrize(("apart", "period"), [(0.9, 2), (1.1, 0)])
def test_poses_came_back_within_the_tolerance_at_the_lever(apart, period):
    by_shift = [_shift(0.0), _shift(1.0), _shift(1e-3 * apart)]
    by_turn = [_shift(0.0), _shift(1.0), _shift(0.0, 1e-4 * apart)]
    for poses in (by_shift, by_turn):
        assert _trail(poses, rotation_scale=10.0).period(1e-3) == period


def test_limits_are_heeded_once_a_step_was_small():
    poses, limits = [_shift(x) for x in (0.0, 1.0, 1.05, 3.0)], [9.0, 8.0, 7.0]
    found = [
        _trail(poses[:k], limits).settled_limit(0.1, pose) for k, pose in enumerate(poses) if k
    ]
    # The step of 0.05 settles it, for good: a large one after it changes nothing.
    assert found == [math.inf, 8.0, 7.0]
    assert _trail(poses[:1], limits).settled_limit(1.01, poses[1]) == 9.0


def test_the_first_iteration_made_no_step_which_is_not_a_small_one():
    assert IcpHistory(10.0).settled_limit(math.inf, _shift(0.0)) == math.inf
    assert _trail([_shift(0.0)]).settled_limit(0.1, _shift(1.0)) == math.inf


def test_poses_of_before_limits_were_held_are_not_waited_for():
    trail = _trail([_shift(float(k % 2)) for k in range(4)])
    assert trail.period(1e-6) == 2
    trail.hold()
    assert trail.period(1e-6) == 0


def test_notes_are_kept_once_and_in_order():
    trail = _trail([_shift(0.0)])
    for text in ("b", "", "a", "b"):
        trail.note(text)
    quadratic = Quadratic(0.5, np.zeros(6), np.eye(6))
    solution = trail.solution(_shift(2.0), quadratic, StopReason.STEP_SMALL)
    assert solution.notes == ("b", "a")
    assert solution.history == tuple(trail.history)
    assert solution.pose == _shift(2.0)
    assert solution.quadratic is quadratic
    assert solution.reason is StopReason.STEP_SMALL


@pytest.mark.parametrize(("distance", "stops"), [(0.0999, True), (0.1, True), (0.1001, False)])
@pytest.mark.parametrize("count", [1, 2])
def test_near_enough_is_enough_from_the_first_pairing_on(distance, stops, count):
    history = _history([_shift(float(k)) for k in range(count)], mean_distance=distance)
    criteria = IcpConvergenceCriteria(mean_distance=0.1)
    reason, note = criteria.reason(history)
    if not stops:
        assert (reason, note) == (None, "")
        return
    assert reason is StopReason.STEP_SMALL
    assert note == f"stopped at a mean pair distance of {distance:.4g} m, at most 0.1 m"


def test_unasked_a_mean_distance_stops_nothing():
    history = _history([_shift(0.0), _shift(1.0)], mean_distance=0.0)
    assert IcpConvergenceCriteria().reason(history) == (None, "")


@pytest.mark.parametrize(("step", "stops"), [(0.99e-3, True), (1e-3, False)])
def test_a_small_step_stops(step, stops):
    history = _history([_shift(0.0), _shift(1.0)], step_norm=step)
    reason, note = IcpConvergenceCriteria(step_tolerance=1e-3).reason(history)
    assert reason is (StopReason.STEP_SMALL if stops else None)
    assert note == ("stopped because the pose changed no more" if stops else "")


def test_the_first_pairing_made_no_step_to_stop_at():
    assert IcpConvergenceCriteria().reason(_history([_shift(0.0)], step_norm=0.0)) == (None, "")


@pytest.mark.parametrize(
    ("before", "last", "stops"),
    [
        (_shift(9.91, 0.4962), _shift(10.0, 0.5), True),
        # Each has to change little on its own.
        (_shift(9.89, 0.5), _shift(10.0, 0.5), False),
        (_shift(10.0, 0.494), _shift(10.0, 0.5), False),
        # A motion without a turn allows no change of turn.
        (_shift(10.0, 1e-6), _shift(10.0, 0.0), False),
        (_shift(9.95), _shift(10.0), True),
    ],
)
def test_a_change_by_a_small_share_of_the_motion_stops(before, last, stops):
    criteria = IcpConvergenceCriteria(relative_change=0.01)
    reason, note = criteria.reason(_history([before, last]))
    assert reason is (StopReason.STEP_SMALL if stops else None)
    assert note == (
        "stopped because translation and rotation changed by 0.01 of themselves at most"
        if stops
        else ""
    )
    assert _NEVER.reason(_history([before, last])) == (None, "")


def test_too_long_is_no_convergence():
    criteria = IcpConvergenceCriteria(max_iterations=3)
    poses = [_shift(float(k)) for k in range(3)]
    assert criteria.reason(_history(poses[:2])) == (None, "")
    reason, note = criteria.reason(_history(poses))
    assert reason is StopReason.ITERATION_LIMIT
    assert note == "stopped after 3 iterations"
    assert not reason.is_converged
    # One that settles in its last iteration has converged.
    settled = _history([*poses[:2], poses[1]], step_norm=0.0)
    assert criteria.reason(settled)[0] is StopReason.STEP_SMALL


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"mean_distance": 0.0}, "mean_distance must be positive, got 0.0 m"),
        ({"change": -0.01}, "change must be at least 0.0, got -0.01"),
        ({"change": math.nan}, "change must be at least 0.0, got nan"),
        ({"step": 0.0}, "step must be positive, got 0.0 m"),
        ({"iterations": 0}, "iterations must be a whole number of at least 1, got 0"),
        ({"iterations": 2.5}, "iterations must be a whole number of at least 1, got 2.5"),
    ],
)
def test_settings_out_of_range_are_refused(settings, message):
    with pytest.raises(InvalidInput, match=message):
        IcpConvergenceCriteria(**settings)
