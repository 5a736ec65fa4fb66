import math

import numpy as np
import pytest

from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.optimisation.solvers.criteria import StopReason
from scanlock.optimisation.solvers.problem import Quadratic
from scanlock.optimisation.solvers.solution import Iteration
from scanlock.registration.methods.icp.correspondences import Correspondences
from scanlock.registration.methods.icp.history import IcpConvergenceCriteria, IcpHistory

_UNREACHABLE = IcpConvergenceCriteria(step_tolerance=1e-300)


def _shift(x, yaw=0.0):
    return Pose.from_step(np.array([x, 0.0, 0.0, 0.0, 0.0, yaw]))


def _found(count=3, mean_distance=0.2, threshold=1.0):
    rows = np.arange(count)
    return Correspondences(rows, rows, np.full(count, mean_distance), np.ones(count), threshold)


def _history(poses, thresholds=None, rotation_scale=10.0):
    history = IcpHistory(_shift(0.0), rotation_scale)
    for k, pose in enumerate(poses):
        history.pose = pose
        threshold = 1.0 if thresholds is None else thresholds[k]
        history.add(Quadratic(0.0, np.zeros(6), np.eye(6)), _found(threshold=threshold))
    return history


def _iterations(poses, step_norm=1.0, mean_distance=0.2):
    return [Iteration(0.0, 0.0, step_norm, True, pose, mean_distance, 3) for pose in poses]


def test_an_iteration_has_its_step_and_gradient_norm():
    history = _history([_shift(1.0, 0.1)], rotation_scale=10.0)
    gradient = np.array([3.0, 0.0, 0.0, 0.0, 40.0, 0.0])
    history.pose = _shift(1.3, 0.14)
    history.add(Quadratic(0.7, gradient, np.eye(6)), _found(8, 0.25), accepted=False)
    first, last = history.iterations
    assert (first.step_norm, first.gradient_norm, first.accepted) == (0.0, 0.0, True)
    # 0.3 m and 0.04 rad at ten metres; 3 per metre and 40 per radian.
    assert last.step_norm == pytest.approx(0.5, rel=1e-9)
    assert last.gradient_norm == pytest.approx(5.0, rel=1e-12)
    assert (last.value, last.accepted, last.pairs, last.mean_distance) == (0.7, False, 8, 0.25)
    assert last.pose == _shift(1.3, 0.14)


@pytest.mark.parametrize("length", range(2, 9))
def test_a_recurring_pose_is_a_cycle(length):
    circle = [_shift(float(k % length)) for k in range(2 * length + 1)]
    for count in range(1, len(circle) + 1):
        found = _history(circle[:count]).cycle_length(1e-6)
        assert found == (length if count > length else 0)


def test_a_constant_pose_and_long_cycles_are_not_detected():
    # A pose that did not change meets the step tolerance.
    assert _history([_shift(0.0), _shift(1.0), _shift(1.0)]).cycle_length(1e-6) == 0
    assert _history([_shift(float(k % 9)) for k in range(10)]).cycle_length(1e-6) == 0
    assert _history([_shift(float(k)) for k in range(30)]).cycle_length(1e-6) == 0


def test_the_shortest_cycle_is_returned():
    assert _history([_shift(float(k % 2)) for k in range(9)]).cycle_length(1e-6) == 2


@pytest.mark.parametrize(("distance", "length"), [(0.9, 2), (1.1, 0)])
def test_poses_recur_within_the_tolerance_with_scaled_rotations(distance, length):
    by_translation = [_shift(0.0), _shift(1.0), _shift(1e-3 * distance)]
    by_rotation = [_shift(0.0), _shift(1.0), _shift(0.0, 1e-4 * distance)]
    for poses in (by_translation, by_rotation):
        assert _history(poses, rotation_scale=10.0).cycle_length(1e-3) == length


def test_a_cycle_bounds_the_threshold_by_its_minimum():
    history = _history(
        [_shift(float(k % 3)) for k in range(5)], thresholds=(0.1, 4.0, 2.0, 0.7, 3.0)
    )
    assert history.max_threshold == math.inf
    history.break_cycle(history.cycle_length(1e-6))
    assert history.max_threshold == 0.7
    assert list(map(str, history.notes)) == ["poses recurred: distance threshold at most 0.7 m"]


def test_poses_before_a_broken_cycle_are_not_compared():
    history = _history([_shift(float(k % 2)) for k in range(4)])
    assert history.cycle_length(1e-6) == 2
    history.break_cycle(2)
    assert history.cycle_length(1e-6) == 0


def _previous(poses, thresholds, switch_step):
    """The previous threshold at the last of these poses."""
    history = _history(poses[:-1], thresholds)
    history.pose = poses[-1]
    return history.previous_threshold(switch_step)


def test_the_previous_threshold_is_used_after_a_small_step():
    poses, thresholds = [_shift(x) for x in (0.0, 1.0, 1.05, 3.0)], [9.0, 8.0, 7.0]
    found = [_previous(poses[: k + 1], thresholds, 0.1) for k in range(1, 4)]
    # The step of 0.05 switches for good: the large step after it does not count.
    assert found == [math.inf, 8.0, 7.0]
    assert _previous(poses[:2], thresholds, 1.01) == 9.0


def test_the_first_iteration_has_no_step():
    assert _previous([_shift(0.0)], [], math.inf) == math.inf
    assert _previous([_shift(0.0), _shift(1.0)], [1.0], 0.1) == math.inf


def test_notes_are_kept_in_order_without_duplicates():
    history = _history([_shift(0.0)])
    for text in ("b", "", "a", "b"):
        history.note(text)
    quadratic = Quadratic(0.5, np.zeros(6), np.eye(6))
    solution = history.solution(_shift(2.0), quadratic, StopReason.STEP_SMALL)
    assert solution.notes == ("b", "a")
    assert solution.history == tuple(history.iterations)
    assert solution.pose == _shift(2.0)
    assert solution.quadratic is quadratic
    assert solution.reason is StopReason.STEP_SMALL


@pytest.mark.parametrize(("distance", "stops"), [(0.0999, True), (0.1, True), (0.1001, False)])
@pytest.mark.parametrize("count", [1, 2])
def test_a_small_mean_distance_stops_from_the_first_iteration_on(distance, stops, count):
    iterations = _iterations([_shift(float(k)) for k in range(count)], mean_distance=distance)
    reason, note = IcpConvergenceCriteria(mean_distance=0.1).reason(iterations)
    if not stops:
        assert (reason, note) == (None, "")
        return
    assert reason is StopReason.STEP_SMALL
    assert str(note) == f"stopped at a mean distance of {distance:.4g} m, at most 0.1 m"


def test_the_mean_distance_is_ignored_by_default():
    iterations = _iterations([_shift(0.0), _shift(1.0)], mean_distance=0.0)
    assert IcpConvergenceCriteria().reason(iterations) == (None, "")


@pytest.mark.parametrize(("step", "stops"), [(0.99e-3, True), (1e-3, False)])
def test_a_small_step_stops(step, stops):
    iterations = _iterations([_shift(0.0), _shift(1.0)], step_norm=step)
    reason, note = IcpConvergenceCriteria(step_tolerance=1e-3).reason(iterations)
    assert reason is (StopReason.STEP_SMALL if stops else None)
    assert note == ("stopped because the pose no longer changed" if stops else "")


def test_the_first_iteration_is_never_below_the_step_tolerance():
    iterations = _iterations([_shift(0.0)], step_norm=0.0)
    assert IcpConvergenceCriteria().reason(iterations) == (None, "")


@pytest.mark.parametrize(
    ("before", "last", "stops"),
    [
        (_shift(9.91, 0.4962), _shift(10.0, 0.5), True),
        # Translation and rotation must both change by little.
        (_shift(9.89, 0.5), _shift(10.0, 0.5), False),
        (_shift(10.0, 0.494), _shift(10.0, 0.5), False),
        # Without a rotation no change of the rotation is small.
        (_shift(10.0, 1e-6), _shift(10.0, 0.0), False),
        (_shift(9.95), _shift(10.0), True),
    ],
)
def test_a_small_relative_change_stops(before, last, stops):
    criteria = IcpConvergenceCriteria(relative_change=0.01)
    reason, note = criteria.reason(_iterations([before, last]))
    assert reason is (StopReason.STEP_SMALL if stops else None)
    assert note == (
        "stopped because translation and rotation changed by a ratio of at most 0.01"
        if stops
        else ""
    )
    assert _UNREACHABLE.reason(_iterations([before, last])) == (None, "")


def test_the_iteration_limit_is_not_convergence():
    criteria = IcpConvergenceCriteria(max_iterations=3)
    poses = [_shift(float(k)) for k in range(3)]
    assert criteria.reason(_iterations(poses[:2])) == (None, "")
    reason, note = criteria.reason(_iterations(poses))
    assert reason is StopReason.ITERATION_LIMIT
    assert note == "stopped after 3 iterations"
    assert not reason.is_converged
    # A small step in the last iteration is convergence.
    last = _iterations([*poses[:2], poses[1]], step_norm=0.0)
    assert criteria.reason(last)[0] is StopReason.STEP_SMALL


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"mean_distance": 0.0}, "mean_distance must be positive, got 0.0 m"),
        ({"relative_change": -0.01}, "relative_change must be at least 0.0, got -0.01"),
        ({"relative_change": math.nan}, "relative_change must be at least 0.0, got nan"),
        ({"step_tolerance": 0.0}, "step_tolerance must be positive, got 0.0 m"),
        ({"max_iterations": 0}, "max_iterations must be a whole number of at least 1, got 0"),
        ({"max_iterations": 2.5}, "max_iterations must be a whole number of at least 1, got 2.5"),
    ],
)
def test_invalid_settings_raise(settings, message):
    with pytest.raises(InvalidInput, match=message):
        IcpConvergenceCriteria(**settings)
