"""Generalised ICP on real scans ends where small_gicp ends, from the same points and start."""

import json
import math

import numpy as np
import pytest

from scanlock.clouds.point_cloud import PointCloud
from scanlock.geometry.pose import Pose
from scanlock.io.scans import read_scan
from scanlock.registration.gicp import Gicp

small_gicp = pytest.importorskip("small_gicp")
pytestmark = pytest.mark.data

_METRES, _RADIANS = 0.001, math.radians(0.005)

_OFFSET = np.array([0.3, -0.2, 0.05, 0.01, -0.005, 0.03])
"""The start, a step away from the trusted pose: within the reach of a gate of 1 m."""

_KITTI = ["0_10", "20_30", "40_50"]


def _floats(path, columns):
    return np.fromfile(path, np.float32).reshape(-1, columns)


def _street(folder, pair):
    folder = folder / "kitti_drive_0005"
    scans = (
        _floats(folder / "velodyne_points" / "data" / f"{int(index):010d}.bin", 4)
        for index in pair.split("_")
    )
    truth = json.loads((folder / "consensus_pairs.json").read_text())[pair]["T"]
    return *scans, Pose.from_matrix(truth)


def _forest(folder, kind):
    folder = folder / "forest_os1"
    scans = (_floats(folder / f"{kind}_t{t}_xyzl.bin", 4) for t in (0, 1))
    return *scans, Pose.from_matrix(np.loadtxt(folder / f"{kind}_reference_transform.txt"))


def _campus(folder, _):
    folder = folder / "hdl32_pair"
    scans = (read_scan(folder / f"{role}.ply").points for role in ("target", "source"))
    return *scans, Pose.from_matrix(np.loadtxt(folder / "T_target_source.txt"))


_PAIRS = [(_street, pair) for pair in _KITTI]
_PAIRS += [(_forest, "still"), (_forest, "moving"), (_campus, "")]


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
        translation_epsilon=1e-5,
        rotation_epsilon=1e-6,
    )
    assert found.converged
    return Pose.from_matrix(found.T_target_source)


@pytest.mark.parametrize(("place", "pair"), _PAIRS)
@pytest.mark.parametrize("neighbours", [10, 20])
def test_closest_pairs_end_in_the_same_minimum(scan_data, place, pair, neighbours):
    target, source, truth = place(scan_data, pair)
    method = Gicp(gates=(1.0,), neighbours=neighbours, tolerance=1e-5)
    kept = [method.prepare(PointCloud.from_array(scan)) for scan in (target, source)]
    start = truth.retract(_OFFSET)
    ours = method.align(*kept, start)
    (cloud, tree), (moving, _) = (_theirs(one, neighbours) for one in kept)
    theirs = _to_the_end(cloud, moving, tree, start=start, gate=1.0)
    assert ours.reason.is_converged
    assert ours.pose.is_close(theirs, translation=_METRES, rotation=_RADIANS)


@pytest.mark.parametrize(("place", "pair"), _PAIRS)
def test_voxels_end_in_the_same_minimum(scan_data, place, pair):
    target, source, truth = place(scan_data, pair)
    method = Gicp(meeting="voxel", voxel_widths=(1.0,), tolerance=1e-5)
    kept = [method.prepare(PointCloud.from_array(scan)) for scan in (target, source)]
    start = truth.retract(_OFFSET)
    ours = method.align(*kept, start)
    (cloud, _), (moving, _) = (_theirs(one, method.neighbours) for one in kept)
    voxels = small_gicp.GaussianVoxelMap(1.0)
    voxels.insert(cloud)
    # No two points of a voxel lie farther apart than its diagonal: this gate leaves out none.
    theirs = _to_the_end(voxels, moving, start=start, gate=2.0)
    assert ours.pose.is_close(theirs, translation=_METRES, rotation=_RADIANS)


@pytest.mark.parametrize(("place", "pair"), _PAIRS)
@pytest.mark.parametrize("method", [Gicp(), Gicp(meeting="voxel")], ids=["gicp", "vgicp"])
def test_from_the_identity_the_trusted_pose_is_found(scan_data, place, pair, method):
    target, source, truth = place(scan_data, pair)
    kept = [method.prepare(PointCloud.from_array(scan)) for scan in (target, source)]
    solution = method.align(*kept, Pose.identity())
    assert solution.reason.is_converged
    # The trusted poses are good to 1 to 3 cm, that of the campus to 0.3 degrees.
    assert solution.pose.is_close(truth, translation=0.05, rotation=math.radians(0.5))
