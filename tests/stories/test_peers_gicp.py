"""Generalised ICP on real scans ends where small_gicp and Open3D end, from the same start."""

import math

import numpy as np
import pytest

from reference.real_pairs import PAIRS, STEP_AWAY, real_pair
from scanlock.clouds.point_cloud import PointCloud
from scanlock.geometry.pose import Pose
from scanlock.models.gaussians import unpacked
from scanlock.registration.methods.correspondences import NearestNeighbourSearch, VoxelSearch
from scanlock.registration.methods.gicp import Gicp

small_gicp = pytest.importorskip("small_gicp")
pytestmark = pytest.mark.data

_METRES, _RADIANS = 0.001, math.radians(0.005)
_WITHIN_A_METRE = NearestNeighbourSearch(max_correspondence_distances=(1.0,))

_with_each_pair = pytest.mark.parametrize("pair", PAIRS)


def _theirs(kept, neighbours):
    """The points that we thinned to, with the covariances that they estimate."""
    cloud = small_gicp.PointCloud(np.array(kept.surface.points))
    tree = small_gicp.KdTree(cloud)
    small_gicp.estimate_covariances(cloud, tree, neighbours)
    return cloud, tree


def _to_the_end(*clouds, start, gate):
    found = small_gicp.align(
        *clouds,
        init_T_target_source=start.matrix,
        max_correspondence_distance=gate,
        max_iterations=100,
        # A tenth of what they may differ by; at less it may refuse its last step for rounding.
        translation_epsilon=1e-4,
        rotation_epsilon=1e-5,
    )
    assert found.converged
    return Pose.from_matrix(found.T_target_source)


@_with_each_pair
@pytest.mark.parametrize("neighbours", [10, 20])
def test_closest_pairs_end_in_the_same_minimum(scan_data, pair, neighbours):
    target, source, truth = real_pair(scan_data, pair)
    method = Gicp(search=_WITHIN_A_METRE, neighbours=neighbours, step_tolerance=1e-5)
    kept = [method.prepare(PointCloud.from_array(scan)) for scan in (target, source)]
    start = truth.retract(STEP_AWAY)
    ours = method.align(*kept, start)
    (cloud, tree), (moving, _) = (_theirs(one, neighbours) for one in kept)
    theirs = _to_the_end(cloud, moving, tree, start=start, gate=1.0)
    assert ours.reason.is_converged
    assert ours.pose.is_close(theirs, translation=_METRES, rotation=_RADIANS)


@_with_each_pair
def test_open3d_ends_in_the_same_minimum(scan_data, pair):
    open3d = pytest.importorskip("open3d", exc_type=ImportError)
    registration = open3d.pipelines.registration
    target, source, truth = real_pair(scan_data, pair)
    method = Gicp(search=_WITHIN_A_METRE, step_tolerance=1e-6)
    kept = [method.prepare(PointCloud.from_array(scan)) for scan in (target, source)]
    start = truth.retract(STEP_AWAY)
    ours = method.align(*kept, start)
    clouds = []
    for one in kept:
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
    theirs = Pose.from_matrix(found.transformation)
    assert ours.reason.is_converged
    assert ours.pose.is_close(theirs, translation=_METRES, rotation=_RADIANS)


@_with_each_pair
def test_voxels_end_in_the_same_minimum(scan_data, pair):
    target, source, truth = real_pair(scan_data, pair)
    method = Gicp(search=VoxelSearch(voxel_sizes=(1.0,)), step_tolerance=1e-5)
    kept = [method.prepare(PointCloud.from_array(scan)) for scan in (target, source)]
    start = truth.retract(STEP_AWAY)
    ours = method.align(*kept, start)
    (cloud, _), (moving, _) = (_theirs(one, method.neighbours) for one in kept)
    voxels = small_gicp.GaussianVoxelMap(1.0)
    voxels.insert(cloud)
    # No two points of a voxel lie farther apart than its diagonal: this gate leaves out none.
    theirs = _to_the_end(voxels, moving, start=start, gate=2.0)
    assert ours.pose.is_close(theirs, translation=_METRES, rotation=_RADIANS)


@_with_each_pair
@pytest.mark.parametrize("method", [Gicp(), Gicp(search=VoxelSearch())], ids=["gicp", "vgicp"])
def test_from_the_identity_the_trusted_pose_is_found(scan_data, pair, method):
    target, source, truth = real_pair(scan_data, pair)
    kept = [method.prepare(PointCloud.from_array(scan)) for scan in (target, source)]
    solution = method.align(*kept, Pose.identity())
    assert solution.reason.is_converged
    # The trusted poses are good to 1 to 3 cm, that of the campus to 0.3 degrees.
    assert solution.pose.is_close(truth, translation=0.05, rotation=math.radians(0.5))
