import numpy as np
import pytest

from reference.samples import yaw_pose
from scanlock.errors import FormatError
from scanlock.io import (
    open_sequence,
    read_numbered_poses,
    write_kitti_poses,
    write_scan,
    write_tum_poses,
)
from scanlock.io.sequences.trajectory import open_trajectory, write_scan_table

_POSES = [yaw_pose(0.1 * k, (1.0 * k, 0.5 * k, 0.0)) for k in range(6)]


def _drive(folder, count=6):
    folder.mkdir(parents=True)
    for k in range(count):
        write_scan(folder / f"{k:06d}.bin", np.ones((3, 3), np.float32))


def test_a_plain_file_has_poses_only(tmp_path):
    write_kitti_poses(tmp_path / "k.txt", _POSES)
    found = open_trajectory(tmp_path / "k.txt")
    assert (len(found), found.times, found.numbers) == (6, None, None)


def test_the_table_of_scans_gives_numbers_and_times(tmp_path):
    _drive(tmp_path / "drive" / "velodyne")
    np.savetxt(tmp_path / "drive" / "times.txt", 0.1 * np.arange(20) + 7.0)
    sequence = open_sequence(tmp_path / "drive", every=2)
    write_kitti_poses(tmp_path / "trajectory_kitti.txt", _POSES[:3])
    write_scan_table(tmp_path / "scans.csv", sequence, 3)
    found = open_trajectory(tmp_path / "trajectory_kitti.txt")
    np.testing.assert_array_equal(found.numbers, [0, 2, 4])
    np.testing.assert_array_equal(found.times, sequence.times)
    assert found.names == ("000000", "000002", "000004")
    # A kill may leave the table one scan ahead.
    write_kitti_poses(tmp_path / "trajectory_kitti.txt", _POSES[:2])
    assert open_trajectory(tmp_path / "trajectory_kitti.txt").names == ("000000", "000002")
    # A file with another number of poses is another trajectory.
    write_kitti_poses(tmp_path / "other.txt", _POSES)
    assert open_trajectory(tmp_path / "other.txt").numbers is None


def test_numbers_of_scans_are_no_times(tmp_path):
    _drive(tmp_path / "drive")
    write_tum_poses(tmp_path / "trajectory_tum.txt", np.arange(6.0), _POSES)
    write_scan_table(tmp_path / "scans.csv", open_sequence(tmp_path / "drive"), 6)
    found = open_trajectory(tmp_path / "trajectory_tum.txt")
    assert found.times is None
    np.testing.assert_array_equal(found.numbers, np.arange(6))


def test_a_damaged_table_is_named(tmp_path):
    write_kitti_poses(tmp_path / "k.txt", _POSES)
    (tmp_path / "scans.csv").write_text("number,name,time\n1,a,noon\n")
    with pytest.raises(
        FormatError, match=r"scans\.csv: data: expected columns number, name and time"
    ):
        open_trajectory(tmp_path / "k.txt")


def test_the_files_of_kitti_odometry_are_found_from_its_poses(tmp_path):
    (tmp_path / "poses").mkdir()
    (tmp_path / "sequences" / "07").mkdir(parents=True)
    write_kitti_poses(tmp_path / "poses" / "07.txt", _POSES)
    path = tmp_path / "poses" / "07.txt"
    assert open_trajectory(path).camera_from_laser is None
    np.savetxt(tmp_path / "sequences" / "07" / "times.txt", 0.1 * np.arange(6))
    (tmp_path / "sequences" / "07" / "calib.txt").write_text("Tr: 0 -1 0 0 0 0 -1 0 1 0 0 -0.3\n")
    found = open_trajectory(path)
    np.testing.assert_allclose(found.times, 0.1 * np.arange(6))
    np.testing.assert_allclose(found.camera_from_laser.translation, [0.0, 0.0, -0.3])
    # Times of another number of poses are not theirs.
    np.savetxt(tmp_path / "sequences" / "07" / "times.txt", 0.1 * np.arange(5))
    assert open_trajectory(path).times is None


def test_a_folder_without_poses_is_refused_with_the_reason(tmp_path):
    _drive(tmp_path / "sequences" / "07" / "velodyne")
    with pytest.raises(FormatError, match=r"KITTI odometry\): calib\.txt and .*07\.txt missing"):
        open_trajectory(tmp_path / "sequences" / "07")
    _drive(tmp_path / "plain")
    with pytest.raises(FormatError, match=r"found none \(folder of scans\): name a file of poses"):
        open_trajectory(tmp_path / "plain")


def test_rows_may_begin_with_the_number_of_the_scan(tmp_path):
    path = tmp_path / "poses.txt"
    write_kitti_poses(path, _POSES[:2])
    first, second = path.read_text().splitlines()
    path.write_text(f"4 {first}\n11 {second}\n")
    found = open_trajectory(path)
    np.testing.assert_array_equal(found.numbers, [4, 11])
    assert found.poses[1].is_close(_POSES[1], translation=1e-12, rotation=1e-7)
    path.write_text(f"4.5 {first}\n11 {second}\n")
    with pytest.raises(FormatError, match=r"line 1: expected the number of a scan, found 4\.5"):
        read_numbered_poses(path)
    with pytest.raises(FormatError):
        open_trajectory(path)


def test_the_calibration_of_a_folder_is_known(tmp_path):
    folder = tmp_path / "sequences" / "07"
    _drive(folder / "velodyne")
    (tmp_path / "poses").mkdir()
    write_kitti_poses(tmp_path / "poses" / "07.txt", _POSES)
    (folder / "calib.txt").write_text("Tr: 0 -1 0 0 0 0 -1 0 1 0 0 -0.3\n")
    found = open_trajectory(folder)
    np.testing.assert_array_equal(found.numbers, np.arange(6))
    np.testing.assert_allclose(found.camera_from_laser.translation, [0.0, 0.0, -0.3])
