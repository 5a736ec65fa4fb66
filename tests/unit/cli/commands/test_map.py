import csv
import json
import signal
import sys

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


@pytest.mark.slow
def test_a_folder_gives_a_trajectory_a_map_and_a_table(scanlock, drive, tmp_path):
    done = scanlock("map", drive, "-o", tmp_path / "out")
    assert (done.code, done.err) == (0, "")
    assert done.out.startswith("ok  3 of 3 pairs are verified")
    poses = read_kitti_poses(tmp_path / "out" / "trajectory_kitti.txt")
    for pose, truth in zip(poses, _POSES, strict=True):
        assert pose.is_close(truth, translation=0.2, rotation=0.02)
    times, stamped = read_tum_poses(tmp_path / "out" / "trajectory_tum.txt")
    np.testing.assert_array_equal(times, np.arange(4.0))
    assert stamped[3].is_close(poses[3], translation=1e-12, rotation=1e-7)
    cloud = read_scan(tmp_path / "out" / "map.ply").points
    assert f"{len(cloud):,} voxels of 0.1 m" in done.out
    assert 10_000 < len(cloud) < 4 * 7000
    # The printed count is that of the file.
    counted = scanlock("crispness", tmp_path / "out" / "map.ply", "--json")
    assert json.loads(counted.out)["maps"][0]["voxels"] == len(cloud)
    with (tmp_path / "out" / "pairs.csv").open(newline="") as handle:
        rows = list(csv.DictReader(handle))
    assert [(row["target"], row["source"], row["status"]) for row in rows] == [
        ("0", "1", "ok"),
        ("1", "2", "ok"),
        ("2", "3", "ok"),
    ]
    np.testing.assert_allclose([float(row["moved_m"]) for row in rows], 1.5, atol=0.1)
    np.testing.assert_allclose([float(row["turned_deg"]) for row in rows], 5.73, atol=0.5)
    assert (tmp_path / "out" / "map.png").read_bytes().startswith(b"\x89PNG")
    # An existing map is never overwritten.
    again = scanlock("map", drive, "-o", tmp_path / "out")
    assert again.code == 1
    assert "contains a map already" in again.err


@pytest.mark.slow
def test_results_are_bitwise_reproducible(scanlock, drive, tmp_path):
    for name in ("a", "b"):
        assert scanlock("map", drive, "-o", tmp_path / name, "--every", "2").code == 0
    for file in sorted((tmp_path / "a").iterdir()):
        assert file.read_bytes() == (tmp_path / "b" / file.name).read_bytes()


@pytest.fixture
def broken_chain(tmp_path):
    """Four scans, two of each of two scenes."""
    folder = tmp_path / "broken"
    folder.mkdir()
    for k, layout in enumerate((42, 42, 77, 77)):
        write_scan(folder / f"{k}.npy", street(k + 1, layout=layout))
    return folder


@pytest.mark.slow
def test_an_untrusted_pair_is_named_and_kept(scanlock, broken_chain, tmp_path):
    done = scanlock("map", broken_chain, "-o", tmp_path / "out", "--guess", "identity")
    assert (done.code, done.err) == (2, "")
    assert done.out.startswith("unverified  2 of 3 pairs")
    assert "the motions to 2: all later poses depend on these" in done.out
    assert len(read_kitti_poses(tmp_path / "out" / "trajectory_kitti.txt")) == 4
    statuses = (tmp_path / "out" / "pairs.csv").read_text()
    assert statuses.count(",ok,") == 2


@pytest.mark.slow
def test_a_drive_can_be_stopped_at_the_first_untrusted_pair(scanlock, broken_chain, tmp_path):
    done = scanlock("map", broken_chain, "-o", tmp_path / "out", "--unverified", "stop")
    assert done.code == 2
    assert done.out.startswith("unverified  1 of 2 pairs")
    joined = " ".join(done.out.split())
    assert "the motions to 2: stopped there, 2 of 4 scans not used" in joined
    assert len(read_kitti_poses(tmp_path / "out" / "trajectory_kitti.txt")) == 2
    with (tmp_path / "out" / "pairs.csv").open(newline="") as handle:
        rows = list(csv.DictReader(handle))
    assert rows[0]["status"] == "ok"
    assert rows[1]["status"] != "ok"
    assert len(rows) == 2


@pytest.mark.slow
def test_a_damaged_scan_leaves_the_map_of_the_previous_ones(scanlock, drive, tmp_path):
    folder = tmp_path / "cut"
    folder.mkdir()
    for k in range(3):
        data = (drive / f"{k}.npy").read_bytes()
        (folder / f"{k}.npy").write_bytes(data[: len(data) // (1 + k // 2)])
    done = scanlock("map", folder, "-o", tmp_path / "out")
    assert done.code == 1
    assert "2.npy" in done.err
    assert f"to {tmp_path / 'out'}" in done.out
    assert len(read_kitti_poses(tmp_path / "out" / "trajectory_kitti.txt")) == 2
    assert len(read_scan(tmp_path / "out" / "map.ply")) > 5000


@pytest.mark.slow
def test_an_interrupt_is_delayed_until_a_scan_is_added(scanlock, monkeypatch, drive, tmp_path):
    from scanlock.evaluation.voxel_map import VoxelMap

    add = VoxelMap.add
    added = []

    def interrupted(self, points):
        added.append(points)
        if len(added) == 3:
            signal.raise_signal(signal.SIGINT)
        add(self, points)

    monkeypatch.setattr(VoxelMap, "add", interrupted)
    done = scanlock("map", drive, "-o", tmp_path / "out")
    assert (done.code, done.err) == (130, "")
    assert done.out.startswith("wrote map.ply")
    assert len(read_kitti_poses(tmp_path / "out" / "trajectory_kitti.txt")) == 3
    assert len((tmp_path / "out" / "pairs.csv").read_text().splitlines()) == 3
    assert len(read_scan(tmp_path / "out" / "map.ply").points) > 2 * 7000


def test_all_files_but_the_picture_are_written_without_matplotlib(
    scanlock, monkeypatch, drive, tmp_path
):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    done = scanlock("map", drive, "-o", tmp_path / "out", "--scans", "2")
    assert done.code == 0
    assert 'no picture: figures need Matplotlib; install it with: pip install "scanlock' in done.out
    names = {path.name for path in (tmp_path / "out").iterdir()}
    tables = {"pairs.csv", "scans.csv"}
    assert names == tables | {"map.ply", "trajectory_kitti.txt", "trajectory_tum.txt"}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--scans", "1"], "--scans must be a whole number of at least 2"),
        (["--every", "0"], "--every"),
        (["--every", "9"], "at least 2 scans, got 1"),
        (["--voxel-size", "0"], "--voxel-size must be positive"),
    ],
)
def test_invalid_numbers_are_an_error_of_one_line(scanlock, drive, tmp_path, options, message):
    done = scanlock("map", drive, "-o", tmp_path / "out", *options)
    assert done.code == 1
    assert message in done.err
    assert done.err.count("\n") == 1


@pytest.mark.slow
def test_a_drive_accepts_locked_directions_and_a_settings_file(scanlock, drive, tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(scanlock("settings", "sgc-ndt-p2d").out)
    done = scanlock("map", drive, "-o", tmp_path / "out", "--settings", path, "--dof", "xy+yaw")
    assert done.code == 0
    for pose in read_kitti_poses(tmp_path / "out" / "trajectory_kitti.txt"):
        np.testing.assert_allclose(pose.matrix[2], [0.0, 0.0, 1.0, 0.0], atol=1e-9)


def test_method_and_settings_exclude_each_other(scanlock, drive, tmp_path):
    done = scanlock("map", drive, "-o", tmp_path, "--method", "icp", "--settings", "mine.toml")
    assert done.code == 1
    assert "give either --method or --settings" in done.err
