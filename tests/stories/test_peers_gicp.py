"""Generalised ICP converges to the poses of small_gicp and Open3D on real scans."""

import math

import numpy as np
import pytest

from reference.real_pairs import PAIRS, STEP_AWAY, real_pair
from scanlock.clouds.point_cloud import PointCloud
from scanlock.geometry.pose import Pose
from scanlock.models.gaussians import unpacked
from scanlock.registration.methods.gicp import Gicp
from scanlock.registration.methods.icp.correspondences import NearestNeighbourSearch, VoxelSearch

small_gicp = pytest.importorskip("small_gicp")
pytestmark = [pytest.mark.slow, pytest.mark.data]

_METRES, _RADIANS = 0.001, math.radians(0.005)
_WITHIN_A_METRE = NearestNeighbourSearch(max_correspondence_distances=(1.0,))

_with_each_pair = pytest.mark.parametrize("pair", PAIRS)


def _small_gicp_cloud(scan, neighbours):
    """Points of a prepared scan, with covariances estimated by small_gicp."""
    cloud = small_gicp.PointCloud(np.array(scan.surface.points))
    tree = small_gicp.KdTree(cloud)
    small_gicp.estimate_covariances(cloud, tree, neighbours)
    return cloud, tree


def _small_gicp_pose(*clouds, start, max_distance):
    found = small_gicp.align(
        *clouds,
        init_T_target_source=start.matrix,
        max_correspondence_distance=max_distance,
        max_iterations=100,
        # A tenth of the tolerance; with less, rounding may prevent the last step.
        translation_epsilon=1e-4,
        rotation_epsilon=1e-5,
    )
    assert found.converged
    return Pose.from_matrix(found.T_target_source)


@_with_each_pair
@pytest.mark.parametrize("neighbours", [10, 20])
def test_small_gicp_converges_to_the_same_pose(scan_data, pair, neighbours):
    target, source, truth = real_pair(scan_data, pair)
    method = Gicp(search=_WITHIN_A_METRE, neighbours=neighbours, step_tolerance=1e-5)
    prepared = [method.prepare(PointCloud.from_array(scan)) for scan in (target, source)]
    start = truth.retract(STEP_AWAY)
    solution = method.align(*prepared, start)
    (cloud, tree), (source_cloud, _) = (_small_gicp_cloud(one, neighbours) for one in prepared)
    peer_pose = _small_gicp_pose(cloud, source_cloud, tree, start=start, max_distance=1.0)
    assert solution.reason.is_converged
    assert solution.pose.is_close(peer_pose, translation=_METRES, rotation=_RADIANS)


@_with_each_pair
def test_open3d_converges_to_the_same_pose(scan_data, pair):
    open3d = pytest.importorskip("open3d", exc_type=ImportError)
    registration = open3d.pipelines.registration
    target, source, truth = real_pair(scan_data, pair)
    method = Gicp(search=_WITHIN_A_METRE, step_tolerance=1e-6)
    prepared = [method.prepare(PointCloud.from_array(scan)) for scan in (target, source)]
    start = truth.retract(STEP_AWAY)
    solution = method.align(*prepared, start)
    clouds = []
    for one in prepared:
        cloud = open3d.geometry.PointCloud(
            open3d.utility.Vector3dVector(np.array(one.surface.points))
        )
        cloud.covariances = open3d.utility.Matrix3dVector(unpacked(one.surface.covariances))
        clouds.append(cloud)
    found = registration.registration_generalized_icp(
        clouds[1],
        clouds[0],
        1.0,
        start.matrix,
        registration.TransformationEstimationForGeneralizedICP(),
        registration.ICPConvergenceCriteria(1e-15, 1e-15, 500),
    )
    peer_pose = Pose.from_matrix(found.transformation)
    assert solution.reason.is_converged
    assert solution.pose.is_close(peer_pose, translation=_METRES, rotation=_RADIANS)


@_with_each_pair
def test_voxels_of_small_gicp_converge_to_the_same_pose(scan_data, pair):
    target, source, truth = real_pair(scan_data, pair)
    method = Gicp(search=VoxelSearch(voxel_sizes=(1.0,)), step_tolerance=1e-5)
    prepared = [method.prepare(PointCloud.from_array(scan)) for scan in (target, source)]
    start = truth.retract(STEP_AWAY)
    solution = method.align(*prepared, start)
    (cloud, _), (source_cloud, _) = (_small_gicp_cloud(one, method.neighbours) for one in prepared)
    voxels = small_gicp.GaussianVoxelMap(1.0)
    voxels.insert(cloud)
    # The diagonal of a voxel is shorter, so this distance rejects no correspondence.
    peer_pose = _small_gicp_pose(voxels, source_cloud, start=start, max_distance=2.0)
    assert solution.pose.is_close(peer_pose, translation=_METRES, rotation=_RADIANS)


@_with_each_pair
@pytest.mark.parametrize("method", [Gicp(), Gicp(search=VoxelSearch())], ids=["gicp", "vgicp"])
def test_the_reference_pose_is_found_from_the_identity(scan_data, pair, method):
    target, source, truth = real_pair(scan_data, pair)
    prepared = [method.prepare(PointCloud.from_array(scan)) for scan in (target, source)]
    solution = method.align(*prepared, Pose.identity())
    assert solution.reason.is_converged
    # The reference poses are accurate to 1 to 3 cm, that of the campus to 0.3 degrees.
    assert solution.pose.is_close(truth, translation=0.05, rotation=math.radians(0.5))
