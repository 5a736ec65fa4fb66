import numpy as np
import pytest
from scipy.io import savemat

from reference.samples import street, yaw_pose
from scanlock.errors import FormatError, InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.io import (
    ScanFile,
    write_kitti_poses,
    write_scan,
    write_scans,
    write_tum_poses,
)
from scanlock.io.datasets.ford import VEHICLE_FROM_LASER, read_ford_scan
from scanlock.io.sequences.open_sequence import open_sequence

_POSES = [yaw_pose(0.1 * k, (1.0 * k, 0.5 * k, 0.0)) for k in range(12)]


def _fill(folder, count=12, ending=".bin"):
    folder.mkdir(parents=True)
    for k in range(count):
        points = np.full((5, 3), 1.0 + k, np.float32)
        points[2] = 0.0
        write_scan(folder / f"{k}{ending}", points)


def test_files_of_a_plain_folder_are_in_natural_order(tmp_path):
    _fill(tmp_path / "drive", ending=".ply")
    (tmp_path / "drive" / "notes.txt").write_text("1 2 3\n")
    found = open_sequence(tmp_path / "drive")
    assert found.names == tuple(str(k) for k in range(12))
    assert found.poses == ()
    np.testing.assert_array_equal(found.times, np.arange(12.0))
    # The row at (0, 0, 0) is removed.
    np.testing.assert_array_equal(found.scan(10), np.full((4, 3), 11.0))


def _stations(path, names):
    scans = [
        ScanFile(points=street(k + 1, 100), fields={}, format="e57", station=name)
        for k, name in enumerate(names)
    ]
    write_scans(path, scans)
    return path


def test_the_stations_of_a_file_are_a_sequence(tmp_path):
    sequence = open_sequence(_stations(tmp_path / "site.ptx", ["", "", ""]), every=2)
    assert (sequence.title, sequence.names) == ("stations", ("site#1", "site#3"))
    np.testing.assert_allclose(sequence.scan(1), street(3, 100), atol=1e-12)
    single = _stations(tmp_path / "single.ptx", [""])
    with pytest.raises(FormatError, match="expected a folder of scans, found a file"):
        open_sequence(single)
    sequence = open_sequence(tmp_path)
    assert sequence.names == ("single", "site#1", "site#2", "site#3")
    np.testing.assert_allclose(sequence.scan(2), street(2, 100), atol=1e-12)


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (("Yard", "Hall"), ("site#Yard", "site#Hall")),
        (("Yard", "Yard"), ("site#1", "site#2")),
        (("2", "1"), ("site#1", "site#2")),
        (("Yard", "a/b"), ("site#1", "site#2")),
        (("Yard", "a#b"), ("site#1", "site#2")),
    ],
)
def test_stations_are_named_where_their_names_are_clear(tmp_path, names, expected):
    pytest.importorskip("pye57")
    sequence = open_sequence(_stations(tmp_path / "site.e57", names))
    assert sequence.names == expected
    np.testing.assert_allclose(sequence.scan(1), street(2, 100), atol=1e-6)


def test_hidden_and_incomplete_files_are_skipped(tmp_path):
    _fill(tmp_path / "drive", 3)
    (tmp_path / "drive" / "._0.bin").write_bytes(b"metadata")
    (tmp_path / "drive" / ".3.bin.1f.part").write_bytes(b"half a scan")
    (tmp_path / "drive" / "01.bin").write_bytes((tmp_path / "drive" / "1.bin").read_bytes())
    assert open_sequence(tmp_path / "drive").names == ("0", "01", "1", "2")


def test_sequences_are_subsampled(tmp_path):
    _fill(tmp_path / "drive")
    write_kitti_poses(tmp_path / "poses.txt", _POSES)
    found = open_sequence(tmp_path / "drive", tmp_path / "poses.txt", every=3, count=3)
    assert found.names == ("0", "3", "6")
    for pose, row in zip(found.poses, (0, 3, 6), strict=True):
        assert pose.is_close(_POSES[row], translation=1e-12, rotation=1e-7)
    np.testing.assert_array_equal(found.times, [0.0, 3.0, 6.0])
    np.testing.assert_array_equal(found.numbers, [0, 3, 6])
    assert len(found.subsampled(2)) == 2
    with pytest.raises(InvalidInput, match="every must be a whole number of at least 1"):
        open_sequence(tmp_path / "drive", every=0)


def _fill_odometry(tmp_path):
    folder = tmp_path / "sequences" / "07"
    _fill(folder / "velodyne")
    calibration = Pose.from_step(np.array([0.1, -0.2, -0.3, 1.2, -1.2, 1.2]))
    cameras = [calibration @ pose @ calibration.inverse() for pose in _POSES]
    (tmp_path / "poses").mkdir()
    write_kitti_poses(tmp_path / "poses" / "07.txt", cameras)
    numbers = " ".join(f"{value:.17g}" for value in calibration.matrix[:3].ravel())
    (folder / "calib.txt").write_text(f"P0: 1 0 0\nTr: {numbers}\n")
    np.savetxt(folder / "times.txt", 0.1 * np.arange(12))
    return folder


def test_kitti_odometry_has_the_poses_of_the_laser(tmp_path, monkeypatch):
    folder = _fill_odometry(tmp_path)
    found = open_sequence(folder)
    assert found.title == "KITTI odometry"
    for pose, expected in zip(found.poses, _POSES, strict=True):
        assert pose.is_close(expected, translation=1e-9, rotation=1e-7)
    np.testing.assert_allclose(found.times, 0.1 * np.arange(12))
    monkeypatch.chdir(folder)
    assert open_sequence(".").poses == found.poses


@pytest.mark.parametrize(
    ("gone", "message"),
    [
        (["calib.txt"], "calib.txt missing"),
        (["../../poses/07.txt"], "../../poses/07.txt missing"),
        (["calib.txt", "../../poses/07.txt"], "calib.txt and ../../poses/07.txt missing"),
    ],
)
def test_missing_files_of_kitti_odometry_are_named(tmp_path, gone, message):
    folder = _fill_odometry(tmp_path)
    assert open_sequence(folder).missing_poses == ""
    for name in gone:
        (folder / name).unlink()
    found = open_sequence(folder)
    assert found.poses == ()
    assert found.missing_poses.startswith(message)


def test_missing_kitti_scans_leave_the_poses_and_times_of_the_others(tmp_path):
    folder = _fill_odometry(tmp_path)
    whole = open_sequence(folder)
    for number in (0, 1, 5, 11):
        (folder / "velodyne" / f"{number}.bin").unlink()
    found = open_sequence(folder)
    assert found.names == ("2", "3", "4", "6", "7", "8", "9", "10")
    rows = [int(name) for name in found.names]
    assert found.poses == tuple(whole.poses[row] for row in rows)
    np.testing.assert_array_equal(found.times, whole.times[rows])
    np.testing.assert_array_equal(found.numbers, rows)
    np.testing.assert_array_equal(found.subsampled(3).numbers, [2, 6, 9])


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("calib.txt", "P0: 1 0 0\n", "expected a line Tr:"),
        ("calib.txt", "Tr: 1 0 0\n", "Tr: expected 12 numbers of a rigid motion"),
        ("calib.txt", "Tr: 2 0 0 0 0 1 0 0 0 0 1 0\n", "Tr: expected 12 numbers of a rigid"),
        ("times.txt", "0.0\nnoon\n", "times.txt: line 2"),
        ("times.txt", "nan\n", "expected a finite time per line"),
        ("../../poses/07.txt", "1 0 0 0\n", "07.txt: line 1"),
    ],
)
def test_damaged_kitti_metadata_is_named(tmp_path, name, content, message):
    folder = _fill_odometry(tmp_path)
    (folder / name).write_text(content)
    with pytest.raises(FormatError, match=message):
        open_sequence(folder)


def test_kitti_raw_has_the_times_of_its_scans(tmp_path):
    data = tmp_path / "drive" / "velodyne_points" / "data"
    _fill(data, 3)
    stamps = data.parent / "timestamps.txt"
    stamps.write_text("2011-09-26 13:04:32.25\n2011-09-26 13:04:33.5\n2011-09-27 00:00:00\n\n")
    found = open_sequence(tmp_path / "drive")
    assert found.title == "KITTI raw"
    # UNIX times of the dates as if they were UTC, whatever the time zone of the machine.
    noon = 1317038400.0
    np.testing.assert_array_equal(found.times, noon + np.array([3872.25, 3873.5, 43200.0]))
    assert "GPS/IMU track of a raw drive is off by decimetres" in found.missing_poses
    stamps.write_text("yesterday\n")
    with pytest.raises(FormatError, match=r"line 1: expected a date and a time, found 'yesterday'"):
        open_sequence(tmp_path / "drive")


def test_simulated_sequences_are_read(tmp_path):
    _fill(tmp_path / "sim" / "scans")
    times = 0.25 * np.arange(12)
    write_tum_poses(tmp_path / "sim" / "poses_tum.txt", times, _POSES)
    found = open_sequence(tmp_path / "sim")
    np.testing.assert_array_equal(found.times, times)
    assert found.poses[5].is_close(_POSES[5], translation=1e-12, rotation=1e-7)


def _ford_file(path, points, pose, time):
    # World and vehicle have z down; the heading is the last of the six numbers.
    savemat(path, {"SCAN": {"XYZ": points.T, "X_wv": pose[:, None], "timestamp_laser": time}})


def test_ford_poses_have_z_up_and_follow_the_vehicle(tmp_path):
    folder = tmp_path / "ford" / "SCANS"
    folder.mkdir(parents=True)
    scan = street(1, 500)
    poses = [np.array([0.0, 0, 0, 0, 0, 0]), np.array([2.0, 1.0, -0.1, 0, 0, np.pi / 2])]
    for k, pose in enumerate(poses):
        _ford_file(folder / f"Scan{75 + k:04d}.mat", scan, pose, np.uint64(1_000_000 * (k + 3)))
    for path in (folder, folder.parent):
        found = open_sequence(path)
        assert found.title == "Ford Campus"
        assert found.names == ("Scan0075", "Scan0076")
        np.testing.assert_allclose(found.times, [3.0, 4.0])
        np.testing.assert_array_equal(found.scan(1), scan)
    first, second = found.poses
    # World with z up, x along the first heading; the laser is 2.3 m above the vehicle.
    np.testing.assert_allclose(first.rotation @ [0, 0, 1], [0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(first.rotation @ [0, 1, 0], [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(first.translation, [2.4, 0.01, 2.3], atol=1e-12)
    # The laser has y ahead and z up, the vehicle x ahead and z down.
    np.testing.assert_allclose(VEHICLE_FROM_LASER.rotation @ [0, 1, 0], [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(VEHICLE_FROM_LASER.rotation @ [0, 0, 1], [0, 0, -1], atol=1e-12)
    between = first.inverse() @ second
    # Two metres ahead, one to the right, slightly up; then a quarter turn to the right.
    rotation_scale = VEHICLE_FROM_LASER.rotation.T @ (
        np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]) @ VEHICLE_FROM_LASER.translation
        - VEHICLE_FROM_LASER.translation
    )
    np.testing.assert_allclose(between.translation - rotation_scale, [1.0, 2.0, 0.1], atol=1e-9)
    np.testing.assert_allclose(between.rotation @ [0, 1, 0], [1, 0, 0], atol=1e-9)


def test_skipped_ford_scans_are_not_read(tmp_path):
    scan = street(1, 500)
    scan[7] = 0.0
    for k in range(5):
        _ford_file(tmp_path / f"Scan{k:04d}.mat", scan, np.full(6, 0.1 * k), np.uint64(k))
    write_kitti_poses(tmp_path / "poses.txt", _POSES[:5])
    (tmp_path / "Scan0001.mat").write_bytes(b"not read")
    found = open_sequence(tmp_path, every=2, count=2)
    assert found.names == ("Scan0000", "Scan0002")
    assert len(found.poses) == 2
    # The row at (0, 0, 0) is removed.
    np.testing.assert_array_equal(found.scan(1), np.delete(scan, 7, axis=0))
    given = open_sequence(tmp_path, tmp_path / "poses.txt", every=2)
    assert given.poses[1].is_close(_POSES[2], translation=1e-12, rotation=1e-7)
    np.testing.assert_allclose(given.times, [0.0, 2e-6, 4e-6])
    with pytest.raises(FormatError, match=r"Scan0001\.mat"):
        open_sequence(tmp_path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"OTHER": 1.0}, "expected a struct SCAN"),
        ({"SCAN": {"XYZ": np.zeros((3, 4))}}, "the field X_wv"),
        (
            {"SCAN": {"XYZ": np.zeros((4, 3)), "X_wv": np.zeros(6), "timestamp_laser": 1.0}},
            r"expected XYZ of shape \(3, n\)",
        ),
        (
            {"SCAN": {"XYZ": np.eye(3), "X_wv": np.full(6, np.nan), "timestamp_laser": 1.0}},
            "a finite pose and time",
        ),
    ],
)
def test_mat_files_without_a_scan_are_refused(tmp_path, content, message):
    savemat(tmp_path / "Scan0001.mat", content)
    with pytest.raises(FormatError, match=message):
        read_ford_scan(tmp_path / "Scan0001.mat")


def test_files_that_are_not_matlab_are_refused(tmp_path):
    (tmp_path / "Scan0001.mat").write_bytes(b"MATLAB? no, something else" * 20)
    with pytest.raises(FormatError, match="expected a MATLAB file"):
        open_sequence(tmp_path)


def test_folders_without_scans_are_refused_with_the_layouts(tmp_path):
    with pytest.raises(FileNotFoundError, match="no such folder"):
        open_sequence(tmp_path / "nowhere")
    with pytest.raises(FormatError, match="found no scan files"):
        open_sequence(tmp_path)
    _fill(tmp_path / "mixed", 2)
    write_scan(tmp_path / "mixed" / "9.ply", np.ones((3, 3)))
    with pytest.raises(FormatError, match=r"found files of \.bin, \.ply"):
        open_sequence(tmp_path / "mixed")


def test_another_number_of_poses_than_scans_is_refused(tmp_path):
    _fill(tmp_path / "drive")
    write_kitti_poses(tmp_path / "poses.txt", _POSES[:5])
    with pytest.raises(FormatError, match="a pose for each of the 12 scans, found 5"):
        open_sequence(tmp_path / "drive", tmp_path / "poses.txt")
