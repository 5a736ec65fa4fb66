"""Pairs of real scans from the identity with default settings, against reference poses."""

import json
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import scanlock
from scanlock.geometry.pose import Pose
from scanlock.registration.registry import METHODS

pytestmark = [pytest.mark.slow, pytest.mark.data]
# ICP, a baseline of the papers, fails on some of these pairs or has errors of decimetres.
_with_each_method = pytest.mark.parametrize(
    "method", [name for name in METHODS if not name.startswith("icp")]
)


def _floats(path, columns):
    return np.fromfile(path, np.float32).reshape(-1, columns)


def _assert_registers(target, source, truth, method, *, metres, degrees):
    result = scanlock.register(source=source, target=target, method=method)
    metres_off, radians_off = result.target_from_source.distance(truth)
    assert result.ok, result.reason
    assert metres_off < metres
    assert math.degrees(radians_off) < degrees


@_with_each_method
@pytest.mark.parametrize("pair", ["0_10", "20_30", "40_50"])
def test_street_scans_a_second_apart_are_registered(scan_data, method, pair):
    # 3 to 4.5 m and 7 to 11 degrees apart, among moving cars; the truth is accurate to 3 cm.
    folder = scan_data / "kitti_drive_0005"
    target, source = (
        _floats(folder / "velodyne_points" / "data" / f"{int(index):010d}.bin", 4)
        for index in pair.split("_")
    )
    truth = Pose.from_matrix(json.loads((folder / "consensus_pairs.json").read_text())[pair]["T"])
    _assert_registers(target, source, truth, method, metres=0.3, degrees=1.0)


@_with_each_method
@pytest.mark.parametrize("kind", ["still", "moving"])
def test_forest_scans_of_a_flight_are_registered(scan_data, method, kind):
    # The truth is a consensus of seven fine registrations, accurate to 5 mm and 0.04 degrees.
    folder = scan_data / "forest_os1"
    target, source = (_floats(folder / f"{kind}_t{t}_xyzl.bin", 4) for t in (0, 1))
    truth = Pose.from_matrix(np.loadtxt(folder / f"{kind}_reference_transform.txt"))
    _assert_registers(target, source, truth, method, metres=0.05, degrees=0.3)


@_with_each_method
def test_scans_of_a_stationary_car_are_registered(scan_data, method):
    folder = scan_data / "av2_pair"
    rows = np.loadtxt(folder / "poses_city_from_ego.txt")
    first, second = (Pose.from_matrix(row[1:].reshape(3, 4)) for row in rows)
    target, source = (_floats(folder / f"00000{k}.bin", 4) for k in range(2))
    truth = first.inverse() @ second
    _assert_registers(target, source, truth, method, metres=0.3, degrees=1.0)


@_with_each_method
def test_handheld_scans_of_a_college_quad_are_registered(scan_data, method):
    folder = scan_data / "newer_college" / "newer_01"
    rows = [line.split()[1:8] for line in (folder / "graph.txt").read_text().splitlines()]
    poses = [
        Pose(Rotation.from_quat(row[3:]).as_matrix(), row[:3])
        for row in np.array(rows, dtype=np.float64)
    ]
    scans = [
        np.vstack([_floats(folder / f"{kind}_{10 * k:06d}.bin", 3) for kind in ("planes", "edges")])
        for k in (0, 2)
    ]
    truth = poses[0].inverse() @ poses[2]
    _assert_registers(*scans, truth, method, metres=0.3, degrees=1.0)


def test_every_point_of_a_real_scan_is_labelled(scan_data):
    scan = _floats(scan_data / "kitti_drive_0005" / "velodyne_points/data/0000000000.bin", 4)
    found = scanlock.segment(scan)
    assert found.labels.shape == (len(scan),)
    # In a street, one to two thirds of the points of an HDL-64E scan are on the ground.
    assert 1 / 3 < found.is_ground.mean() < 2 / 3
    assert found.cluster_count > 50
