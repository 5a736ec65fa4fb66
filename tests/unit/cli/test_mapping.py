import numpy as np
import pytest

from reference.samples import street, yaw_pose
from scanlock.io import read_kitti_poses, read_scan, read_tum_poses, write_scan

_POSES = [yaw_pose(0.1 * k, (1.5 * k, 0.0, 0.0)) for k in range(4)]


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    folder = tmp_path_factory.mktemp("drive")
    for k, pose in enumerate(_POSES):
        write_scan(folder / f"{k}.npy", pose.inverse().apply(street(k + 1)))
    return folder


def test_a_folder_becomes_a_trajectory_a_map_and_a_table(scanlock, drive, tmp_path):
    done = scanlock("map", drive, "-o", tmp_path / "out")
    assert (done.code, done.err) == (0, "")
    assert done.out.startswith("ok  3 of 3 pairs are to be trusted")
    poses = read_kitti_poses(tmp_path / "out" / "trajectory_kitti.txt")
    for pose, truth in zip(poses, _POSES, strict=True):
        assert pose.is_close(truth, translation=0.2, rotation=0.02)
    times, stamped = read_tum_poses(tmp_path / "out" / "trajectory_tum.txt")
    np.testing.assert_array_equal(times, np.arange(4.0))
    assert stamped[3].is_close(poses[3], translation=1e-12, rotation=1e-7)
    cloud = read_scan(tmp_path / "out" / "map.ply").points
    assert f"{len(cloud):,} voxels of 0.1 m" in done.out
    assert 10_000 < len(cloud) < 4 * 7000
    rows = (tmp_path / "out" / "pairs.csv").read_text().splitlines()
    assert len(rows) == 4
    assert rows[1].startswith("1,0,1,ok,")
    # A map is the work of minutes: it is never overwritten.
    again = scanlock("map", drive, "-o", tmp_path / "out")
    assert again.code == 1
    assert "holds a map already" in again.err


def test_the_same_folder_twice_gives_the_same_bytes(scanlock, drive, tmp_path):
    for name in ("a", "b"):
        assert scanlock("map", drive, "-o", tmp_path / name, "--every", "2").code == 0
    for file in sorted((tmp_path / "a").iterdir()):
        assert file.read_bytes() == (tmp_path / "b" / file.name).read_bytes()


def test_a_pair_that_is_not_to_be_trusted_is_named(scanlock, drive, tmp_path):
    for k in range(2):
        write_scan(tmp_path / f"{k}.npy", street(k, layout=50 + k))
    done = scanlock("map", tmp_path, "-o", tmp_path / "out", "--guess", "identity")
    assert done.code == 2
    assert done.out.startswith("doubtful  0 of 1 pairs")
    assert "the motions to 1" in done.out


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--scans", "1"], "--scans must be a whole number of at least 2"),
        (["--every", "0"], "--every"),
        (["--every", "9"], "at least 2 scans to map, got 1"),
        (["--width", "0"], "--width must be positive"),
    ],
)
def test_wrong_numbers_are_one_line(scanlock, drive, tmp_path, options, message):
    done = scanlock("map", drive, "-o", tmp_path / "out", *options)
    assert done.code == 1
    assert message in done.err
    assert done.err.count("\n") == 1
