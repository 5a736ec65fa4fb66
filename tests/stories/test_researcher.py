"""A researcher's first day with a trajectory: map a KITTI drive, and compare it with the truth."""

import json
import os
import shutil
import subprocess
import sys

import numba
import numpy as np
import pytest

from scanlock.evaluation.sensor_axes import CAMERA_FROM_LASER, in_other_frame
from scanlock.geometry.pose import Pose
from scanlock.io import read_tum_poses, write_kitti_poses

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        numba.config.DISABLE_JIT, reason="simulating without a compiler takes minutes"
    ),
]

_CALIBRATION = CAMERA_FROM_LASER @ Pose.from_step(
    np.array([0.27, 0.0, -0.08, 0.008, -0.007, 0.001])
)


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
