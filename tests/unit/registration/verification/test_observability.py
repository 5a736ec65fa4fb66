import math

import numpy as np
import pytest

from scanlock.clouds.point_cloud import PointCloud
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.registration.verification.cluster_constraints import ClusterConstraints
from scanlock.registration.verification.local_planes import LocalPlaneFitter, LocalPlanes
from scanlock.registration.verification.observability import observability_of
from scanlock.registration.verification.plane_constraints import plane_constraints

_NO_CLUSTERS = ClusterConstraints.unconstrained()


def _planes(points, normals, residuals=None):
    n = len(points)
    return LocalPlanes(
        has_plane=np.ones(n, np.bool_),
        points=np.array(points, float),
        normals=np.array(normals, float),
        residuals=np.zeros(n) if residuals is None else np.array(residuals, float),
        normal_covariances=np.zeros((n, 3, 3)),
        flatness=np.ones(n),
        thickness=np.full(n, 0.02),
    )


def _observability(planes, origin=(0.0, 0.0, 0.0), clusters=_NO_CLUSTERS):
    return observability_of(plane_constraints(planes, np.array(origin)), clusters)


def _room(rng, count=40, axes=(0, 1, 2)):
    """Points on the walls of a room, each with the normal of its wall."""
    points, normals = [], []
    for axis in axes:
        found = rng.uniform(-5.0, 5.0, (count, 3))
        found[:, axis] = rng.choice([-6.0, 6.0], count)
        points.append(found)
        normals.append(np.tile(np.eye(3)[axis], (count, 1)))
    return np.concatenate(points), np.concatenate(normals)


def test_a_room_constrains_all_directions_as_least_squares_predicts():
    points, normals = _room(np.random.default_rng(0))
    residuals = np.random.default_rng(1).normal(0.0, 0.02, len(points))
    origin = (1.0, 2.0, 0.5)
    observability = _observability(_planes(points, normals, residuals), origin)
    assert not any(one.is_degenerate for one in observability.directions)
    jacobian = np.hstack([normals, np.cross(points - origin, normals)])
    weights = 1.0 / (1.0 + (residuals / 0.1) ** 2)
    information = jacobian.T @ (weights[:, None] * jacobian)
    noise = np.sqrt(weights @ residuals**2 / weights.sum())
    covariance = noise**2 * np.linalg.inv(information)
    for block, directions in (
        (slice(0, 3), observability.directions[:3]),
        (slice(3, 6), observability.directions[3:]),
    ):
        expected = [np.sqrt(one.axis @ covariance[block, block] @ one.axis) for one in directions]
        np.testing.assert_allclose([one.deviation for one in directions], expected, rtol=1e-6)
    # A third of the planes is perpendicular to each axis.
    ratios = [one.ratio for one in observability.directions[:3]]
    np.testing.assert_allclose(ratios, 1.0 / 3.0, rtol=0.05)


@pytest.mark.parametrize("axis", range(3))
def test_the_direction_without_walls_is_degenerate_and_named(axis):
    walls = [one for one in range(3) if one != axis]
    observability = _observability(_planes(*_room(np.random.default_rng(0), axes=walls)))
    degenerate = [one for one in observability.directions if one.is_degenerate]
    assert [one.kind for one in degenerate] == ["translation"]
    assert degenerate[0].name == ("forward", "left", "up")[axis]
    assert degenerate[0].name in str(degenerate[0])


def test_a_round_wall_does_not_constrain_rotations_about_its_axis():
    angles = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    radial = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(60)])
    points = np.concatenate([8.0 * radial + [0, 0, 1], 3.0 * radial])
    normals = np.concatenate([radial, np.tile([0.0, 0.0, 1.0], (60, 1))])
    observability = _observability(_planes(points, normals))
    assert [one.name for one in observability.directions if one.is_degenerate] == ["yaw"]


def test_directions_between_the_axes_are_named_by_their_components():
    rotation = exp_rotation(np.array([0.0, 0.0, math.radians(45.0)]))
    points, normals = _room(np.random.default_rng(0), axes=[1, 2])
    observability = _observability(_planes(points @ rotation.T, normals @ rotation.T))
    (degenerate,) = (one for one in observability.directions if one.is_degenerate)
    assert degenerate.name.startswith("along (")
    assert "0.71" in degenerate.name


def test_directions_rotate_with_the_planes():
    # Walls with different numbers of points, so that all eigenvalues are distinct.
    walls = [
        _room(np.random.default_rng(3), count, [axis]) for axis, count in enumerate((50, 30, 20))
    ]
    points, normals = (np.concatenate(arrays) for arrays in zip(*walls, strict=True))
    rotation = exp_rotation(np.array([0.3, -0.2, 0.9]))
    one = _observability(_planes(points, normals))
    other = _observability(_planes(points @ rotation.T, normals @ rotation.T))
    for before, after in zip(one.directions, other.directions, strict=True):
        np.testing.assert_allclose(after.deviation, before.deviation, rtol=1e-9)
        assert abs(after.axis @ rotation @ before.axis) == pytest.approx(1.0, abs=1e-6)


def test_fix_degenerate_takes_degenerate_directions_from_the_prior_only():
    # A corridor along x with slightly rotated walls: the pose must stay on them.
    points, normals = _room(np.random.default_rng(0), axes=[1, 2])
    rotation = exp_rotation(np.array([0.0, 0.0, 0.02]))
    pose = Pose(exp_rotation(np.array([0.0, 0.0, 0.3])), np.array([4.0, 1.0, 0.2]))
    planes = _planes(points @ rotation.T, normals @ rotation.T)
    observability = _observability(planes, pose.translation)
    prior = Pose(exp_rotation(np.array([0.0, 0.1, 0.5])), np.array([1.5, 3.0, -1.0]))
    fixed = observability.fix_degenerate(pose, prior)
    (degenerate,) = observability.degenerate
    left = degenerate.axis @ (fixed.translation - prior.translation)
    assert left == pytest.approx(0.0, abs=1e-9)
    shift = fixed.translation - pose.translation
    assert np.linalg.norm(shift - degenerate.axis * (degenerate.axis @ shift)) < 1e-6
    assert fixed.distance(pose)[1] < 1e-3
    unchanged = observability.fix_degenerate(pose, pose)
    assert unchanged.is_close(pose, translation=1e-12, rotation=1e-12)


def test_fix_degenerate_returns_a_constrained_pose_unchanged():
    observability = _observability(_planes(*_room(np.random.default_rng(0))))
    pose = Pose.from_step(np.array([1.0, 2.0, 3.0, 0.1, 0.2, 0.3]))
    assert observability.fix_degenerate(pose, Pose.identity()) is pose


def test_a_direction_constrained_by_clusters_is_not_degenerate():
    points, normals = _room(np.random.default_rng(0), axes=[1, 2])
    clusters = ClusterConstraints(
        information=np.diag([0.5, 1.0, 0.1, 1.0, 1.0, 1.0]), max_information=np.eye(6)
    )
    observability = _observability(_planes(points, normals), clusters=clusters)
    assert observability.directions[0].cluster_ratio == pytest.approx(0.5)
    assert observability.degenerate == ()


def test_points_on_a_line_do_not_constrain_rotations_about_it():
    points = np.column_stack([np.linspace(-20.0, 20.0, 80), np.zeros((80, 2))])
    observability = _observability(_planes(points, np.tile([[0.0, 0.0, 1.0]], (80, 1))))
    assert all(0.0 <= one.ratio <= 1.0 for one in observability.directions)
    roll = next(one for one in observability.directions if one.name == "roll")
    assert roll.is_degenerate


def _field(heights, noise, seed=3):
    """Return the planes between two noisy sparse clouds of terrain, a point per 0.08 units^2."""
    rng = np.random.default_rng(seed)
    first, second = (
        np.column_stack([xy, heights(xy) + rng.normal(0.0, noise, len(xy))])
        for xy in rng.uniform(-10.0, 10.0, (2, 5000, 2))
    )
    fitter = LocalPlaneFitter(voxel_size=0.25, max_points=2000, radii=(0.5, 0.7, 1.0))
    queries = fitter.query_points(PointCloud.from_array(second))
    return fitter.fit(fitter.cell_list(PointCloud.from_array(first)), queries)


def _sparse_observability(planes):
    constraints = plane_constraints(planes, np.zeros(3))
    return observability_of(constraints, _NO_CLUSTERS, is_sparse=True)


@pytest.mark.parametrize("noise", [0.005, 0.02, 0.05])
@pytest.mark.parametrize("strip", [0.0, 0.02])
def test_noise_and_strips_do_not_constrain_flat_sparse_ground(noise, strip):
    planes = _field(lambda xy: strip * (xy[:, 0] // 3.0 % 2.0), noise)
    found = _sparse_observability(planes).degenerate
    assert sorted(one.kind for one in found) == ["rotation", "translation", "translation"]
    assert strip or all(one.bias_multiple < 2.0 for one in found)


def test_low_furrows_of_sparse_ground_constrain_the_direction_across():
    planes = _field(lambda xy: 0.12 * np.sin(xy[:, 0]), 0.01)
    (found,) = (
        one for one in _sparse_observability(planes).degenerate if one.kind == "translation"
    )
    assert abs(found.axis[1]) > 0.98
    # The ratios of both directions are small: hardly any plane is steep from above.
    assert len(_observability(planes).degenerate) == 3


def test_low_hills_constrain_all_directions_of_sparse_clouds_only():
    planes = _field(lambda xy: 0.2 * np.sin(0.8 * xy[:, 0]) * np.cos(0.7 * xy[:, 1]), 0.01)
    assert not _sparse_observability(planes).degenerate
    assert {one.name for one in _observability(planes).degenerate} >= {"yaw"}
    assert all(one.bias_multiple == 0.0 for one in _observability(planes).directions)
