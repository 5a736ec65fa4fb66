import math

import numpy as np
import pytest

from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.registration.verification.cluster_constraints import ClusterConstraints
from scanlock.registration.verification.local_planes import LocalPlanes
from scanlock.registration.verification.observability import observability_of
from scanlock.registration.verification.plane_constraints import plane_constraints

_NONE = ClusterConstraints.none()
"""Parts that hold nothing."""


def _surface(points, normals, residuals=None, flatness=None):
    n = len(points)
    return LocalPlanes(
        np.ones(n, np.bool_),
        np.array(points, float),
        np.array(normals, float),
        np.zeros(n) if residuals is None else np.array(residuals, float),
        np.zeros((n, 3, 3)),
        np.ones(n) if flatness is None else np.array(flatness, float),
        np.full(n, 0.02),
    )


def _hold(surface, origin, by_parts):
    return observability_of(plane_constraints(surface, origin), by_parts)


def _room(rng, count=40, axes=(0, 1, 2)):
    """Planes of a room: places on its walls, each with the normal of its wall."""
    points, normals = [], []
    for axis in axes:
        found = rng.uniform(-5.0, 5.0, (count, 3))
        found[:, axis] = rng.choice([-6.0, 6.0], count)
        points.append(found)
        normals.append(np.tile(np.eye(3)[axis], (count, 1)))
    return np.concatenate(points), np.concatenate(normals)


def test_a_room_holds_all_and_its_information_is_that_of_least_squares():
    points, normals = _room(np.random.default_rng(0))
    residuals = np.random.default_rng(1).normal(0.0, 0.02, len(points))
    observability = _hold(_surface(points, normals, residuals), np.array([1.0, 2.0, 0.5]), _NONE)
    assert not any(one.is_degenerate for one in observability.directions)
    rows = np.hstack([normals, np.cross(points - [1.0, 2.0, 0.5], normals)])
    weights = 1.0 / (1.0 + (residuals / 0.1) ** 2)
    information = rows.T @ (weights[:, None] * rows)
    noise = np.sqrt(weights @ residuals**2 / weights.sum())
    variances = noise**2 * np.linalg.inv(information)
    for block, found in (
        (slice(0, 3), observability.directions[:3]),
        (slice(3, 6), observability.directions[3:]),
    ):
        spread = [np.sqrt(one.axis @ variances[block, block] @ one.axis) for one in found]
        np.testing.assert_allclose([one.deviation for one in found], spread, rtol=1e-6)
    # A third of the planes face each way.
    np.testing.assert_allclose(
        [one.ratio for one in observability.directions[:3]], 1.0 / 3.0, rtol=0.05
    )


@pytest.mark.parametrize("axis", range(3))
def test_the_direction_without_walls_is_weak_and_named(axis):
    rest = [one for one in range(3) if one != axis]
    observability = _hold(_surface(*_room(np.random.default_rng(0), axes=rest)), np.zeros(3), _NONE)
    degenerate = [one for one in observability.directions if one.is_degenerate]
    assert [one.kind for one in degenerate] == ["translation"]
    assert degenerate[0].name == ("forward", "left", "up")[axis]
    assert degenerate[0].name in str(degenerate[0])


def test_a_round_wall_does_not_hold_the_turn_about_its_axis():
    angles = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    out = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(60)])
    points = np.concatenate([8.0 * out + [0, 0, 1], 3.0 * out])
    normals = np.concatenate([out, np.tile([0.0, 0.0, 1.0], (60, 1))])
    observability = _hold(_surface(points, normals), np.zeros(3), _NONE)
    assert [one.name for one in observability.directions if one.is_degenerate] == ["yaw"]


def test_directions_between_the_axes_are_given_in_numbers():
    turn = exp_rotation(np.array([0.0, 0.0, math.radians(45.0)]))
    points, normals = _room(np.random.default_rng(0), axes=[1, 2])
    observability = _hold(_surface(points @ turn.T, normals @ turn.T), np.zeros(3), _NONE)
    (degenerate,) = (one for one in observability.directions if one.is_degenerate)
    assert degenerate.name.startswith("along (")
    assert "0.71" in degenerate.name


def test_directions_turn_with_the_planes():
    # Walls of different numbers, so that each direction has its own eigenvalue.
    sides = [
        _room(np.random.default_rng(3), count, [axis]) for axis, count in enumerate((50, 30, 20))
    ]
    points, normals = (np.concatenate(parts) for parts in zip(*sides, strict=True))
    turn = exp_rotation(np.array([0.3, -0.2, 0.9]))
    one = _hold(_surface(points, normals), np.zeros(3), _NONE)
    other = _hold(_surface(points @ turn.T, normals @ turn.T), np.zeros(3), _NONE)
    for before, after in zip(one.directions, other.directions, strict=True):
        np.testing.assert_allclose(after.deviation, before.deviation, rtol=1e-9)
        assert abs(after.axis @ turn @ before.axis) == pytest.approx(1.0, abs=1e-6)


def test_weak_directions_go_back_to_the_prior_and_the_others_stay():
    # A corridor along x whose walls are tilted a little: the way back must not leave them.
    points, normals = _room(np.random.default_rng(0), axes=[1, 2])
    turn = exp_rotation(np.array([0.0, 0.0, 0.02]))
    pose = Pose(exp_rotation(np.array([0.0, 0.0, 0.3])), np.array([4.0, 1.0, 0.2]))
    observability = _hold(_surface(points @ turn.T, normals @ turn.T), pose.translation, _NONE)
    prior = Pose(exp_rotation(np.array([0.0, 0.1, 0.5])), np.array([1.5, 3.0, -1.0]))
    backward = observability.fix_degenerate(pose, prior)
    (degenerate,) = observability.degenerate
    assert degenerate.axis @ (backward.translation - prior.translation) == pytest.approx(
        0.0, abs=1e-9
    )
    moved = backward.translation - pose.translation
    assert np.linalg.norm(moved - degenerate.axis * (degenerate.axis @ moved)) < 1e-6
    assert backward.distance(pose)[1] < 1e-3
    assert observability.fix_degenerate(pose, pose).is_close(
        pose, translation=1e-12, rotation=1e-12
    )


def test_a_pose_that_is_held_all_round_stays():
    observability = _hold(_surface(*_room(np.random.default_rng(0))), np.zeros(3), _NONE)
    pose = Pose.from_step(np.array([1.0, 2.0, 3.0, 0.1, 0.2, 0.3]))
    assert observability.fix_degenerate(pose, Pose.identity()) is pose


def test_what_parts_hold_is_not_weak():
    points, normals = _room(np.random.default_rng(0), axes=[1, 2])
    holding = ClusterConstraints(np.diag([0.5, 1.0, 0.1, 1.0, 1.0, 1.0]), np.eye(6))
    observability = _hold(_surface(points, normals), np.zeros(3), holding)
    assert observability.directions[0].cluster_ratio == pytest.approx(0.5)
    assert observability.degenerate == ()


def test_places_on_a_line_hold_no_turn_about_it():
    points = np.column_stack([np.linspace(-20.0, 20.0, 80), np.zeros((80, 2))])
    normals = np.tile([[0.0, 0.0, 1.0]], (80, 1))
    observability = _hold(_surface(points, normals), np.zeros(3), _NONE)
    assert all(0.0 <= one.ratio <= 1.0 for one in observability.directions)
    roll = next(one for one in observability.directions if one.name == "roll")
    assert roll.is_degenerate
