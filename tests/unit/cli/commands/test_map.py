import csv
import json
import re
import signal
import sys

import numpy as np
import pytest

from reference.samples import street, yaw_pose
from scanlock.io import (
    ScanFile,
    read_kitti_poses,
    read_scan,
    read_tum_poses,
    write_scan,
    write_scans,
)

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
    assert re.search(r"time +\d+\.\d s without compiling, [\d.]+ scans/s\n", done.out)
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
    assert all(0.9 < float(row["probability"]) <= 1.0 for row in rows)
    assert all(float(row["milliseconds"]) > 0.0 for row in rows)
    motions = np.array([row["target_from_source"].split() for row in rows], float)
    chain = poses[2].inverse().matrix @ poses[3].matrix
    np.testing.assert_allclose(motions[2].reshape(3, 4), chain[:3], atol=1e-12)
    assert (tmp_path / "out" / "map.png").read_bytes().startswith(b"\x89PNG")
    # An existing map is never overwritten.
    again = scanlock("map", drive, "-o", tmp_path / "out")
    assert again.code == 1
    assert "contains a map already; use another folder, --resume" in again.err


def _files(folder):
    """Content of every file by name; of the table of pairs without the times."""
    found = {path.name: path.read_bytes() for path in folder.iterdir()}
    lines = found["pairs.csv"].decode().splitlines()
    found["pairs.csv"] = [line.rsplit(",", 1)[0] for line in lines]
    return found


@pytest.mark.slow
def test_results_are_bitwise_reproducible_but_for_the_times(scanlock, drive, tmp_path):
    for name, threads in (("a", "1"), ("b", "2")):
        done = scanlock("map", drive, "-o", tmp_path / name, "--every", "2", "--threads", threads)
        assert done.code == 0
    assert _files(tmp_path / "a") == _files(tmp_path / "b")


@pytest.mark.slow
@pytest.mark.parametrize("guess", ["velocity", "identity"])
def test_a_resumed_map_equals_one_without_an_interrupt(scanlock, drive, tmp_path, guess):
    options = ["--guess", guess, "--covariance", "sandwich"]
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    assert scanlock("map", drive, "-o", whole, *options).code == 0
    assert scanlock("map", drive, "-o", broken, *options, "--scans", "2").code == 0
    # As after a kill, which leaves poses and table only.
    (broken / "map.ply").unlink()
    done = scanlock("map", drive, "-o", broken, *options, "--resume")
    assert (done.code, done.err) == (0, "")
    assert "3 of 3 pairs are verified" in done.out
    assert _files(broken) == _files(whole)
    done = scanlock("map", drive, "-o", broken, *options, "--resume", "--verbose")
    assert done.code == 0
    assert re.search(r"\n +3 +2 +3 +ok +0.9\d\d +1\.", done.out)
    assert _files(broken) == _files(whole)


def test_a_map_with_other_options_or_scans_is_not_continued(scanlock, drive, tmp_path):
    out, other = tmp_path / "out", tmp_path / "other"
    method = ["--method", "sgc-ndt-d2d"]
    assert scanlock("map", drive, "-o", out, "--scans", "2", *method).code == 0
    before = _files(out)
    done = scanlock("map", drive, "-o", out, "--resume", *method, "--dof", "xy+yaw")
    assert done.code == 1
    assert "dof was xyz+rpy, is xy+yaw; use --overwrite" in done.err
    done = scanlock("map", drive, "-o", out, "--resume", *method, "--set", "voxel_size=0.4")
    assert "method was SgcNdt" in done.err
    other.mkdir()
    for k in range(2):
        (other / f"scan{k}.npy").write_bytes((drive / f"{k}.npy").read_bytes())
    done = scanlock("map", other, "-o", out, "--resume", *method)
    assert "scan 1 was 1, is scan1; use --overwrite" in done.err
    assert "either --overwrite or --resume" in scanlock(
        "map", drive, "-o", out, "--resume", "--overwrite"
    ).err  # fmt: skip
    assert _files(out) == before
    done = scanlock("map", other, "-o", out, "--overwrite", *method)
    assert done.code == 0
    assert _files(out)["pairs.csv"] != before["pairs.csv"]


def test_nothing_to_continue_is_a_new_map(scanlock, drive, tmp_path):
    done = scanlock("map", drive, "-o", tmp_path / "out", "--scans", "2", "--resume")
    assert (done.code, done.err) == (0, "")
    assert (tmp_path / "out" / "map.ply").exists()


def test_the_folder_is_made_but_not_its_parents(scanlock, drive, tmp_path):
    done = scanlock("map", drive, "-o", tmp_path / "typo" / "out", "--scans", "2")
    assert done.code == 1
    assert "typo" in done.err
    assert not (tmp_path / "typo").exists()


def test_a_map_has_the_fields_of_the_scans(scanlock, tmp_path):
    folder = tmp_path / "drive"
    folder.mkdir()
    for k, pose in enumerate(_POSES[:2]):
        points = np.vstack([pose.inverse().apply(street(k + 1)), np.zeros((1, 3))])
        fields = {
            "Reflectivity": np.full(len(points), 10 * (k + 1), np.uint16),
            "t": np.arange(len(points), dtype=np.uint32),
            "ring": np.zeros(len(points), np.uint8),
        }
        write_scan(folder / f"{k}.ply", points, fields)
    done = scanlock("map", folder, "-o", tmp_path / "out", "--map-format", "npz")
    assert done.code == 0
    found = read_scan(tmp_path / "out" / "map.npz")
    assert list(found.fields) == ["scan", "t", "intensity"]
    scan, intensity = found.fields["scan"], found.fields["intensity"]
    assert set(scan.tolist()) == {0, 1}
    assert set(intensity[scan == 1].tolist()) == {20.0}
    assert 10.0 <= intensity[scan == 0].min() < intensity[scan == 0].max() < 20.0
    assert found.fields["t"].dtype == np.uint32
    # The blank row is no point of the map.
    assert not (np.abs(found.points) < 0.05).all(axis=1).any()


@pytest.mark.parametrize("ending", ["las", "ply"])
def test_intensities_of_any_format_are_written_as_any_other(scanlock, tmp_path, ending):
    pytest.importorskip("laspy")
    folder, out = tmp_path / "drive", tmp_path / "out"
    folder.mkdir()
    for k, pose in enumerate(_POSES[:2]):
        points = pose.inverse().apply(street(k + 1))
        write_scan(folder / f"{k}.las", points, {"intensity": np.full(len(points), 7, np.uint16)})
    assert scanlock("map", folder, "-o", out, "--map-format", ending).code == 0
    assert set(read_scan(out / f"map.{ending}").fields["intensity"].tolist()) == {7}


def test_the_stations_of_a_file_are_mapped(scanlock, tmp_path):
    stations = [
        ScanFile(points=pose.inverse().apply(street(k + 1)), fields={}, format="ptx")
        for k, pose in enumerate(_POSES[:3])
    ]
    write_scans(tmp_path / "site.ptx", stations)
    out = tmp_path / "out"
    done = scanlock("map", tmp_path / "site.ptx", "-o", out)
    assert (done.code, done.err) == (0, "")
    assert "(stations)" in done.out
    for pose, truth in zip(read_kitti_poses(out / "trajectory_kitti.txt"), _POSES, strict=False):
        assert pose.is_close(truth, translation=0.2, rotation=0.02)
    assert "2,site#3,2.0" in (out / "scans.csv").read_text()


@pytest.mark.slow
def test_scans_in_map_coordinates_give_a_map_in_them(scanlock, tmp_path):
    far = np.array([500_000.0, 5_400_000.0, 120.0])
    folder = tmp_path / "stations"
    folder.mkdir()
    for k in range(3):
        turned = yaw_pose(0.01 * k, (0.3 * k, 0.1 * k, 0.0))
        write_scan(folder / f"station{9 + k}.npy", turned.inverse().apply(street(k + 1)) + far)
    done = scanlock("map", folder, "-o", tmp_path / "out", "--map-format", "npz")
    assert (done.code, done.err) == (0, "")
    assert "path" not in done.out
    found = read_scan(tmp_path / "out" / "map.npz")
    assert found.coordinate_dtype == "float64"
    middle = np.median(street(1), axis=0) + far
    assert np.abs(np.median(found.points, axis=0) - middle).max() < 2.0
    with (tmp_path / "out" / "pairs.csv").open(newline="") as handle:
        rows = list(csv.DictReader(handle))
    assert [row["source"] for row in rows] == ["station10", "station11"]
    np.testing.assert_allclose(
        [float(row["moved_m"]) for row in rows], np.hypot(0.3, 0.1), atol=0.1
    )
    poses = read_kitti_poses(tmp_path / "out" / "trajectory_kitti.txt")
    # Each pose takes the coordinates of its file to those of the first one.
    landed = poses[2].apply(read_scan(folder / "station11.npy").points) - far
    truth = yaw_pose(0.02, (0.6, 0.2, 0.0)).apply(read_scan(folder / "station11.npy").points - far)
    assert np.abs(landed - truth).max() < 0.2
    done = scanlock("crispness", tmp_path / "out" / "map.npz", "--json")
    assert json.loads(done.out)["maps"][0]["points"] == len(found)


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

    def interrupted(self, points, **fields):
        added.append(points)
        if len(added) == 3:
            signal.raise_signal(signal.SIGINT)
        add(self, points, **fields)

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
    assert 'no picture: figures need Matplotlib: pip install "scanlock' in done.out
    names = {path.name for path in (tmp_path / "out").iterdir()}
    tables = {"options.json", "pairs.csv", "scans.csv"}
    assert names == tables | {"map.ply", "trajectory_kitti.txt", "trajectory_tum.txt"}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--scans", "1"], "--scans must be a whole number of at least 2"),
        (["--every", "0"], "--every"),
        (["--every", "9"], "at least 2 scans, got 1"),
        (["--voxel-size", "0"], "--voxel-size must be positive"),
        (["--threads", "0"], "--threads must be a whole number"),
        (["--set", "voxelsize=1"], "voxelsize is not a setting of Auto"),
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
