"""The work of a robotics researcher: a map of a drive, its errors, and a choice of methods."""

import csv
import json
import os
import re
import shutil
import subprocess
import sys

import numba
import numpy as np
import pytest

from reference.real_pairs import real_pair
from scanlock.cli import main
from scanlock.evaluation.sensor_axes import CAMERA_FROM_LASER, in_other_frame
from scanlock.geometry.pose import Pose
from scanlock.io import read_pose, read_scan, read_tum_poses, write_kitti_poses

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        numba.config.DISABLE_JIT, reason="simulating without a compiler takes minutes"
    ),
]

_CALIBRATION = CAMERA_FROM_LASER @ Pose.from_step(
    np.array([0.27, 0.0, -0.08, 0.008, -0.007, 0.001])
)


def _run(capsys, *arguments):
    capsys.readouterr()
    code = main([str(argument) for argument in arguments])
    done = capsys.readouterr()
    return code, done.out, done.err


@pytest.mark.data
def test_a_drive_is_mapped_and_compared_with_the_truth(scan_data, tmp_path, capsys):
    drive, out = scan_data / "kitti_drive_0005", tmp_path / "map"
    code, text, _ = _run(capsys, "map", drive, "-o", out, "--scans", 12, "--threads", 2)
    assert code == 0
    assert text.startswith("ok  11 of 11 pairs are verified\n")
    assert "(KITTI raw)" in text
    assert re.search(r"time +[\d.]+ s without compiling, [\d.]+ scans/s\n", text)
    # UNIX times: the drive is of 26 September 2011, and evo matches by them.
    times, _ = read_tum_poses(out / "trajectory_tum.txt")
    assert 1_316_995_200 < times[0] < times[-1] < 1_316_995_200 + 86_400 * 1.5
    picture = tmp_path / "errors.png"
    for name in ("trajectory_kitti.txt", "trajectory_tum.txt"):
        arguments = ("evaluate", out / name, drive / "consensus_chain.txt")
        code, text, _ = _run(capsys, *arguments, "--picture", picture)
        assert code == 0
        assert re.match(r"0\.0[012]\d m and 0\.0\d\d deg off \(rmse\) over 3\.\d m", text)
        told = " ".join(text.split())
        assert "12 poses by scan number, of 12 estimated and 60 true" in told
        assert "absolute (APE) [m]" in told
        assert "relative over 1 scan (RPE) [deg]" in told
    assert picture.stat().st_size > 20_000


@pytest.mark.data
def test_methods_are_compared_on_a_pair_with_its_truth(scan_data, tmp_path, capsys):
    *_, truth = real_pair(scan_data, "street 0_10")
    np.savetxt(tmp_path / "truth.txt", truth.matrix)
    scans = scan_data / "kitti_drive_0005" / "velodyne_points" / "data"
    out, names = tmp_path / "methods", ("auto", "ndt-d2d", "gicp")
    code, text, _ = _run(
        capsys, "compare", scans / "0000000000.bin", scans / "0000000010.bin", "-o", out,
        "--methods", *names, "--truth", tmp_path / "truth.txt", "--starts", 0,
    )  # fmt: skip
    assert code == 0
    for name in names:
        row = re.search(rf"^ *{name} +1 / 1 +1 / 1 +(\S+) +(\S+) +(\d+)$", text, re.MULTILINE)
        assert float(row[1]) < 0.1
        assert float(row[2]) < 0.3
    assert "without reading and compiling" in text
    page = (out / "index.md").read_text()
    assert all(f"| {name} |" in page for name in names)
    assert (out / "figures" / "errors.png").stat().st_size > 10_000
    assert (out / "settings" / "gicp.toml").exists()


@pytest.mark.data
def test_scans_written_by_open3d_give_the_pose_of_the_drive(scan_data, tmp_path, capsys):
    open3d = pytest.importorskip("open3d", exc_type=ImportError)
    target, source, truth = real_pair(scan_data, "street 0_10")
    paths = [tmp_path / "source.pcd", tmp_path / "target.ply"]
    for path, points in zip(paths, (source, target), strict=True):
        vectors = open3d.utility.Vector3dVector(points[:, :3].astype(np.float64))
        assert open3d.io.write_point_cloud(str(path), open3d.geometry.PointCloud(vectors))
    pose, merged = tmp_path / "pose.txt", tmp_path / "merged.ply"
    code, text, _ = _run(capsys, "register", *paths, "-o", pose, "--merged", merged)
    assert code == 0
    assert re.search(r"accuracy +right with 9\d\.\d%; [\d.]+ mm and [\d.]+ deg at one", text)
    assert read_pose(pose).is_close(truth, translation=0.1, rotation=0.005)
    both = open3d.io.read_point_cloud(str(merged))
    assert len(both.points) == len(source) + len(target)
    assert len(np.unique(np.asarray(both.colors), axis=0)) == 2


@pytest.mark.data
def test_captures_name_their_converter(scan_data, tmp_path, capsys):
    captures = scan_data / "formats" / "ouster"
    [capture] = captures.glob("OS-1*.pcap")
    for arguments in (("info", capture), ("map", capture, "-o", tmp_path / "out")):
        code, _, err = _run(capsys, *arguments)
        assert code == 1
        assert f"ouster-cli source {capture} save" in err
    code, _, err = _run(capsys, "map", captures, "-o", tmp_path / "out")
    assert code == 1
    assert "no scans here" in err
    assert not (tmp_path / "out").exists()


@pytest.mark.data
def test_a_drive_is_continued_and_its_map_has_intensity_and_scan_numbers(
    scan_data, tmp_path, capsys
):
    drive, whole, broken = scan_data / "kitti_drive_0005", tmp_path / "whole", tmp_path / "broken"
    assert _run(capsys, "map", drive, "-o", whole, "--scans", 8, "--threads", 2)[0] == 0
    assert _run(capsys, "map", drive, "-o", broken, "--scans", 5)[0] == 0
    assert _run(capsys, "map", drive, "-o", broken, "--scans", 8, "--resume")[0] == 0
    for name in ("map.ply", "trajectory_kitti.txt", "trajectory_tum.txt", "map.png"):
        assert (whole / name).read_bytes() == (broken / name).read_bytes()
    found = read_scan(whole / "map.ply")
    assert set(found.fields["scan"].tolist()) == set(range(8))
    assert 0.0 <= found.fields["intensity"].min() < found.fields["intensity"].max() <= 1.0
    with (whole / "pairs.csv").open(newline="") as handle:
        rows = list(csv.DictReader(handle))
    assert all(float(row["probability"]) > 0.9 for row in rows)
    assert all(0.0 < float(row["milliseconds"]) < 60_000.0 for row in rows)
    assert _run(capsys, "crispness", whole / "map.ply", broken / "map.ply")[0] == 0
    assert _run(capsys, "map", drive, "-o", tmp_path / "few", "--scans", 3)[0] == 0
    code, _, err = _run(capsys, "crispness", whole / "map.ply", tmp_path / "few" / "map.ply")
    assert code == 1
    assert "got 8 scans" in err


def _scanlock(*arguments):
    code = "import sys; from scanlock.cli import main; sys.exit(main())"
    return subprocess.run(
        [sys.executable, "-W", "error", "-c", code, *map(str, arguments)],
        env=os.environ | {"COLUMNS": "80"},
        capture_output=True,
        text=True,
        check=False,
    )


def _evaluated(*arguments):
    done = _scanlock("evaluate", *arguments, "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def data_set(tmp_path_factory):
    """A simulated street in the folders of KITTI odometry, with the true poses of the camera."""
    root = tmp_path_factory.mktemp("kitti")
    drive = root / "simulated"
    done = _scanlock(
        "simulate", "street", "-o", drive, "--scans", 9, "--every", 5, "--sensor", "hdl-32e"
    )
    assert done.returncode == 0, done.stderr
    sequence = root / "sequences" / "07"
    (sequence / "velodyne").mkdir(parents=True)
    scans = sorted((drive / "scans").iterdir())
    for row, path in enumerate(scans):
        shutil.copy(path, sequence / "velodyne" / f"{row:06d}.bin")
    times, poses = read_tum_poses(drive / "poses_tum.txt")
    np.savetxt(sequence / "times.txt", times - times[0])
    numbers = " ".join(f"{value:.17g}" for value in _CALIBRATION.matrix[:3].ravel())
    (sequence / "calib.txt").write_text(f"Tr: {numbers}\n")
    (root / "poses").mkdir()
    world = poses[0].inverse()
    laser = [world @ pose for pose in poses]
    write_kitti_poses(root / "poses" / "07.txt", in_other_frame(laser, _CALIBRATION))
    return root


@pytest.fixture(scope="module")
def mapped(data_set):
    """The map of every other scan."""
    out = data_set / "out"
    done = _scanlock("map", data_set / "sequences" / "07", "-o", out, "--every", 2)
    assert done.returncode == 0, done.stderr + done.stdout
    return out


def test_the_root_of_the_data_set_names_the_sequence_to_map(data_set, tmp_path):
    done = _scanlock("map", data_set / "sequences", "-o", tmp_path / "out")
    assert done.returncode == 1
    assert f"holds 1 sequence; name one: {data_set / 'sequences' / '07'}" in done.stderr
    assert not (tmp_path / "out").exists()


def test_the_downloaded_truth_and_its_folder_give_the_same_errors(data_set, mapped):
    tracks = [mapped / name for name in ("trajectory_kitti.txt", "trajectory_tum.txt")]
    by_file = [_evaluated(track, data_set / "poses" / "07.txt") for track in tracks]
    by_folder = [_evaluated(track, data_set / "sequences" / "07") for track in tracks]
    for found in by_file + by_folder:
        assert (found["poses"], found["truth_poses"], found["matched_by"]) == (5, 9, "time")
        assert found["relative"]["translation_m"]["rmse"] < 0.05
        for part in ("absolute", "relative"):
            expected = by_folder[0][part]["translation_m"]["rmse"]
            np.testing.assert_allclose(found[part]["translation_m"]["rmse"], expected, rtol=1e-6)
    assert by_file[0]["frame"] == "camera to laser (calib.txt)"
    assert by_folder[0]["frame"] == "same"


def test_a_truth_that_left_its_data_set_is_matched_by_scan_number(data_set, mapped, tmp_path):
    alone = tmp_path / "07.txt"
    shutil.copy(data_set / "poses" / "07.txt", alone)
    done = _scanlock("evaluate", mapped / "trajectory_kitti.txt", alone)
    assert done.returncode == 0, done.stderr
    text = " ".join(done.stdout.split())
    assert "5 poses by scan number, of 5 estimated and 9 true" in text
    assert "camera frame, converted to the laser's by nominal axes" in text
    assert all(len(line) <= 80 for line in done.stdout.splitlines())
    calibration = data_set / "sequences" / "07" / "calib.txt"
    exact = _evaluated(mapped / "trajectory_kitti.txt", alone, "--calib", calibration)
    whole = _evaluated(mapped / "trajectory_kitti.txt", data_set / "sequences" / "07")
    np.testing.assert_allclose(
        exact["absolute"]["translation_m"]["rmse"],
        whole["absolute"]["translation_m"]["rmse"],
        rtol=1e-6,
    )


def test_a_missing_file_is_named_before_it_is_missed(data_set, mapped, tmp_path):
    copy = tmp_path / "sequences" / "07"
    shutil.copytree(data_set / "sequences" / "07", copy)
    done = _scanlock("evaluate", mapped / "trajectory_tum.txt", copy)
    assert done.returncode == 1
    assert "../../poses/07.txt missing" in done.stderr
