"""ICP on real scans ends where small_gicp and Open3D end, from the same points and start."""

import math

import numpy as np
import pytest

from reference.real_pairs import PAIRS, STEP_AWAY, real_pair
from scanlock.clouds.point_cloud import PointCloud
from scanlock.geometry.pose import Pose
from scanlock.optimisation.objectives.point_pairs import PointPairs
from scanlock.optimisation.solvers.gauss_newton import gauss_newton_step
from scanlock.registration.methods.icp import Icp
from scanlock.registration.methods.icp_history import IcpConvergenceCriteria
from scanlock.registration.methods.rejection import FixedRejection
from scanlock.registration.methods.transform_estimation import TransformEstimation

pytestmark = pytest.mark.data

_METRES, _RADIANS = 0.001, math.radians(0.005)
"""How far apart two ends may be. Hardly any differ at all. But pairs change with the pose, and
where a peer steps differently it can end at another fixed point; of 72 starts each, one of
small_gicp did, by 0.32 mm and 0.001 degrees, and one of Open3D, by 0.16 mm."""

_SAME_METRES, _SAME_RADIANS = 1e-5, 1e-6
"""How far apart ends may be at one fixed point: by the step at which small_gicp stops."""

_with_each_pair = pytest.mark.parametrize("pair", PAIRS)
_with_each_gate = pytest.mark.parametrize("gate", [0.5, 1.0])


def _icp(gate, residual="point-to-point", step="gauss-newton"):
    return Icp(
        rejection=FixedRejection(max_correspondence_distance=gate),
        estimation=TransformEstimation(algorithm=step, residual=residual),
        criteria=IcpConvergenceCriteria(step_tolerance=1e-8, max_iterations=500),
    )


def _prepared(scan_data, pair, method):
    *scans, truth = real_pair(scan_data, pair)
    kept = [method.prepare(PointCloud.from_array(scan)) for scan in scans]
    return kept, truth.retract(STEP_AWAY)


def _by_small_gicp(kept, start, gate, kind, neighbours=10):
    """Where small_gicp ends, and the normals of the target that it estimates."""
    small_gicp = pytest.importorskip("small_gicp")
    target, source = (small_gicp.PointCloud(np.array(one.points)) for one in kept)
    tree = small_gicp.KdTree(target)
    small_gicp.estimate_normals(target, tree, neighbours)
    found = small_gicp.align(
        target,
        source,
        tree,
        init_T_target_source=start.matrix,
        registration_type=kind,
        max_correspondence_distance=gate,
        max_iterations=500,
        translation_epsilon=_SAME_METRES,
        rotation_epsilon=_SAME_RADIANS,
    )
    # Its flag also falls where rounding alone forbids a last step, so only the count is asked.
    assert found.iterations < 499
    return Pose.from_matrix(found.T_target_source), target.normals()[:, :3]


def _by_open3d(kept, start, gate, kind):
    """Where Open3D ends, for planes with our normals."""
    open3d = pytest.importorskip("open3d", exc_type=ImportError)
    registration = open3d.pipelines.registration
    target, source = (
        open3d.geometry.PointCloud(open3d.utility.Vector3dVector(np.array(one.points)))
        for one in kept
    )
    if kind == "PointToPlane":
        target.normals = open3d.utility.Vector3dVector(np.array(kept[0].normals))
    found = registration.registration_icp(
        source,
        target,
        gate,
        start.matrix,
        getattr(registration, f"TransformationEstimation{kind}")(),
        # Both are changes in the mean over the pairs: it stops when these pairs came back.
        registration.ICPConvergenceCriteria(1e-15, 1e-15, 500),
    )
    return Pose.from_matrix(found.transformation)


def _assert_same_minimum(method, kept, start, theirs):
    ours = method.align(*kept, start)
    assert ours.reason.is_converged
    assert ours.pose.is_close(theirs, translation=_METRES, rotation=_RADIANS)
    # Another fixed point is one of ours too: begun there, nothing moves.
    stayed = method.align(*kept, theirs)
    assert stayed.pose.is_close(theirs, translation=_SAME_METRES, rotation=_SAME_RADIANS)


@_with_each_pair
@_with_each_gate
def test_all_steps_end_in_one_minimum(scan_data, pair, gate):
    kept, start = _prepared(scan_data, pair, _icp(gate))
    ends = [
        _icp(gate, step=step).align(*kept, start) for step in ("svd", "quaternion", "gauss-newton")
    ]
    assert all(end.reason.is_converged for end in ends)
    for end in ends[1:]:
        assert end.pose.is_close(ends[0].pose, translation=1e-6, rotation=1e-7)


@_with_each_pair
@_with_each_gate
def test_points_end_where_small_gicp_ends(scan_data, pair, gate):
    method = _icp(gate, step="svd")
    kept, start = _prepared(scan_data, pair, method)
    theirs, _ = _by_small_gicp(kept, start, gate, "ICP")
    _assert_same_minimum(method, kept, start, theirs)


@_with_each_pair
@_with_each_gate
@pytest.mark.parametrize(
    ("kind", "residual"),
    [("PointToPoint", "point-to-point"), ("PointToPlane", "point-to-plane")],
)
def test_points_and_planes_end_where_open3d_ends(scan_data, pair, gate, kind, residual):
    method = _icp(gate, residual)
    kept, start = _prepared(scan_data, pair, method)
    theirs = _by_open3d(kept, start, gate, kind)
    _assert_same_minimum(method, kept, start, theirs)


def _by_axes(kept, start, gate, normals):
    """Where our pairs and steps end with another residual: ``n_x d_x, n_y d_y, n_z d_z``."""
    method, pose = _icp(gate), start
    for _ in range(100):
        pairs = method.correspondences(*kept, pose)
        precisions = np.zeros((len(pairs), 6))
        precisions[:, [0, 3, 5]] = normals[pairs.target_rows] ** 2
        objective = PointPairs(
            target=kept[0].points,
            source=kept[1].points,
            target_rows=pairs.target_rows,
            source_rows=pairs.source_rows,
            precisions=precisions,
        )
        step = gauss_newton_step(objective.linearise(pose), 20.0)
        if np.abs(step).max() < 1e-8:
            return pose
        pose = pose.retract(step)
    pytest.fail("the pairs never settled")


@_with_each_pair
@_with_each_gate
def test_planes_of_small_gicp_are_our_pairs_with_another_residual(scan_data, pair, gate):
    # Its PLANE_ICP multiplies normal and distance along each axis and never sums: no distance
    # to a plane, and another minimum. All else is as ours: normals, pairs, steps.
    kept, start = _prepared(scan_data, pair, _icp(gate, "point-to-plane"))
    theirs, normals = _by_small_gicp(kept, start, gate, "PLANE_ICP")
    cosines = np.abs(np.einsum("na,na->n", normals, kept[0].normals))
    np.testing.assert_allclose(cosines, 1.0, atol=1e-6)
    again = _by_axes(kept, theirs, gate, normals)
    assert again.is_close(theirs, translation=_SAME_METRES, rotation=_SAME_RADIANS)
    ours = _by_axes(kept, start, gate, normals)
    assert ours.is_close(theirs, translation=_METRES, rotation=_RADIANS)
