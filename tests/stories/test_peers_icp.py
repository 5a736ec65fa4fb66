"""ICP converges to the poses of small_gicp and Open3D from the same points and initial pose."""

import math

import numpy as np
import pytest

from reference.real_pairs import PAIRS, STEP_AWAY, real_pair
from scanlock.clouds.point_cloud import PointCloud
from scanlock.geometry.pose import Pose
from scanlock.optimisation.objectives.point_pairs import PointPairs
from scanlock.optimisation.solvers.gauss_newton import gauss_newton_step
from scanlock.registration.methods.icp.distance_rejection import FixedRejection
from scanlock.registration.methods.icp.history import IcpConvergenceCriteria
from scanlock.registration.methods.icp.icp import Icp
from scanlock.registration.methods.icp.transform_estimation import TransformEstimation

pytestmark = [pytest.mark.slow, pytest.mark.data]

_METRES, _RADIANS = 0.001, math.radians(0.005)
"""Maximum difference of two converged poses.

Nearly all are equal. Different steps can lead to another fixed point of the correspondences: of 72
starts each, one differs by 0.32 mm and 0.001 degrees in small_gicp, and one by 0.16 mm in Open3D.
"""

_FIXED_POINT_METRES, _FIXED_POINT_RADIANS = 1e-5, 1e-6
"""Maximum difference at one fixed point: the step tolerance of small_gicp."""

_with_each_pair = pytest.mark.parametrize("pair", PAIRS)
_with_each_distance = pytest.mark.parametrize("max_distance", [0.5, 1.0])


def _icp(max_distance, residual="point-to-point", step="gauss-newton"):
    return Icp(
        rejection=FixedRejection(max_correspondence_distance=max_distance),
        estimation=TransformEstimation(algorithm=step, residual=residual),
        criteria=IcpConvergenceCriteria(step_tolerance=1e-8, max_iterations=500),
    )


def _prepared(scan_data, pair, method):
    *scans, truth = real_pair(scan_data, pair)
    prepared = [method.prepare(PointCloud.from_array(scan)) for scan in scans]
    return prepared, truth.retract(STEP_AWAY)


def _by_small_gicp(prepared, start, max_distance, kind, neighbours=10):
    """Pose of small_gicp, and its normals of the target."""
    small_gicp = pytest.importorskip("small_gicp")
    target, source = (small_gicp.PointCloud(np.array(one.points)) for one in prepared)
    tree = small_gicp.KdTree(target)
    small_gicp.estimate_normals(target, tree, neighbours)
    found = small_gicp.align(
        target,
        source,
        tree,
        init_T_target_source=start.matrix,
        registration_type=kind,
        max_correspondence_distance=max_distance,
        max_iterations=500,
        translation_epsilon=_FIXED_POINT_METRES,
        rotation_epsilon=_FIXED_POINT_RADIANS,
    )
    # Rounding can prevent its last step and so clear `converged`; the count is reliable.
    assert found.iterations < 499
    return Pose.from_matrix(found.T_target_source), target.normals()[:, :3]


def _by_open3d(prepared, start, max_distance, kind):
    """Pose of Open3D, for planes with the normals of scanlock."""
    open3d = pytest.importorskip("open3d", exc_type=ImportError)
    registration = open3d.pipelines.registration
    target, source = (
        open3d.geometry.PointCloud(open3d.utility.Vector3dVector(np.array(one.points)))
        for one in prepared
    )
    if kind == "PointToPlane":
        target.normals = open3d.utility.Vector3dVector(np.array(prepared[0].normals))
    found = registration.registration_icp(
        source,
        target,
        max_distance,
        start.matrix,
        getattr(registration, f"TransformationEstimation{kind}")(),
        # Changes of the means over the correspondences: zero when the correspondences recur.
        registration.ICPConvergenceCriteria(1e-15, 1e-15, 500),
    )
    return Pose.from_matrix(found.transformation)


def _assert_converges_to(method, prepared, start, peer_pose):
    solution = method.align(*prepared, start)
    assert solution.reason.is_converged
    assert solution.pose.is_close(peer_pose, translation=_METRES, rotation=_RADIANS)
    # The pose of the peer is a fixed point of scanlock as well.
    restarted = method.align(*prepared, peer_pose)
    assert restarted.pose.is_close(
        peer_pose, translation=_FIXED_POINT_METRES, rotation=_FIXED_POINT_RADIANS
    )


@_with_each_pair
@_with_each_distance
def test_all_estimation_algorithms_converge_to_one_pose(scan_data, pair, max_distance):
    prepared, start = _prepared(scan_data, pair, _icp(max_distance))
    solutions = [
        _icp(max_distance, step=step).align(*prepared, start)
        for step in ("svd", "quaternion", "gauss-newton")
    ]
    assert all(solution.reason.is_converged for solution in solutions)
    for solution in solutions[1:]:
        assert solution.pose.is_close(solutions[0].pose, translation=1e-6, rotation=1e-7)


@_with_each_pair
@_with_each_distance
def test_point_to_point_converges_to_the_pose_of_small_gicp(scan_data, pair, max_distance):
    method = _icp(max_distance, step="svd")
    prepared, start = _prepared(scan_data, pair, method)
    peer_pose, _ = _by_small_gicp(prepared, start, max_distance, "ICP")
    _assert_converges_to(method, prepared, start, peer_pose)


@_with_each_pair
@_with_each_distance
@pytest.mark.parametrize(
    ("kind", "residual"),
    [("PointToPoint", "point-to-point"), ("PointToPlane", "point-to-plane")],
)
def test_both_residuals_converge_to_the_pose_of_open3d(
    scan_data, pair, max_distance, kind, residual
):
    method = _icp(max_distance, residual)
    prepared, start = _prepared(scan_data, pair, method)
    peer_pose = _by_open3d(prepared, start, max_distance, kind)
    _assert_converges_to(method, prepared, start, peer_pose)


def _componentwise_pose(prepared, start, max_distance, normals):
    """Converged pose with the residual ``n_x d_x, n_y d_y, n_z d_z``."""
    method, pose = _icp(max_distance), start
    for _ in range(100):
        pairs = method.correspondences(*prepared, pose)
        precisions = np.zeros((len(pairs), 6))
        precisions[:, [0, 3, 5]] = normals[pairs.target_rows] ** 2
        objective = PointPairs(
            target=prepared[0].points,
            source=prepared[1].points,
            target_rows=pairs.target_rows,
            source_rows=pairs.source_rows,
            precisions=precisions,
        )
        step = gauss_newton_step(objective.linearise(pose), 20.0)
        if np.abs(step).max() < 1e-8:
            return pose
        pose = pose.retract(step)
    pytest.fail("the correspondences did not converge")


@_with_each_pair
@_with_each_distance
def test_planes_of_small_gicp_are_reproduced_with_a_componentwise_residual(
    scan_data, pair, max_distance
):
    # PLANE_ICP multiplies normal and difference along each axis without a sum, so its residual is
    # not the distance to the plane. Normals, correspondences and steps are those of scanlock.
    prepared, start = _prepared(scan_data, pair, _icp(max_distance, "point-to-plane"))
    peer_pose, normals = _by_small_gicp(prepared, start, max_distance, "PLANE_ICP")
    cosines = np.abs(np.einsum("na,na->n", normals, prepared[0].normals))
    np.testing.assert_allclose(cosines, 1.0, atol=1e-6)
    from_peer_pose = _componentwise_pose(prepared, peer_pose, max_distance, normals)
    assert from_peer_pose.is_close(
        peer_pose, translation=_FIXED_POINT_METRES, rotation=_FIXED_POINT_RADIANS
    )
    solution = _componentwise_pose(prepared, start, max_distance, normals)
    assert solution.is_close(peer_pose, translation=_METRES, rotation=_RADIANS)
