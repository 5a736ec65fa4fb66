"""First use of the command line: demo, register, info and segment."""

import json
import os
import subprocess
import sys

import numba
import numpy as np
import pytest

from scanlock.geometry.pose import Pose
from scanlock.io import read_labels, read_pose, read_scan

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        numba.config.DISABLE_JIT, reason="simulating without a compiler takes minutes"
    ),
]


def _scanlock(*arguments, cwd=None):
    code = "import sys; from scanlock.cli import main; sys.exit(main())"
    return subprocess.run(
        [sys.executable, "-W", "error", "-c", code, *map(str, arguments)],
        cwd=cwd,
        env=os.environ | {"COLUMNS": "80"},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    folder = tmp_path_factory.mktemp("demo")
    return folder / "scanlock-demo", _scanlock("demo", cwd=folder)


def test_the_demo_registers_a_street_and_draws_a_picture(demo):
    folder, done = demo
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("ok  source onto target\n")
    metres, radians = read_pose(folder / "pose.txt").distance(read_pose(folder / "exact_pose.txt"))
    assert metres < 0.1
    assert np.degrees(radians) < 0.3
    assert (folder / "picture.png").stat().st_size > 50_000
    for line in done.stdout.splitlines():
        assert len(line) <= 80 or "scanlock-demo" in line


def test_the_files_of_the_demo_give_the_same_pose(demo):
    folder, _ = demo
    done = _scanlock(
        "register", folder / "source.ply", folder / "target.ply", "--json", "-o",
        folder / "again.json",
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    printed = json.loads(done.stdout)
    assert printed == json.loads((folder / "again.json").read_text())
    np.testing.assert_array_equal(
        np.array(printed["target_from_source"]), np.loadtxt(folder / "pose.txt")
    )


def test_a_scan_of_the_demo_can_be_described_and_segmented(demo):
    folder, _ = demo
    about = json.loads(_scanlock("info", folder / "source.ply", "--json").stdout)
    done = _scanlock("segment", folder / "source.ply", "-o", folder / "labels.npy")
    assert (done.returncode, done.stderr) == (0, "")
    labels = read_labels(folder / "labels.npy", count=about["points"])
    assert about["points"] == len(read_scan(folder / "source.ply"))
    assert labels.max() > 50
    assert 0.2 < (labels == 0).mean() < 0.9


def test_scans_of_different_places_exit_with_2_and_a_missing_file_with_1(demo, tmp_path):
    folder, _ = demo
    rng = np.random.default_rng(0)
    posts = rng.uniform(-30.0, 30.0, (12, 1, 3)) * [1.0, 1.0, 0.0]
    np.save(tmp_path / "posts.npy", (posts + rng.uniform(0.0, 2.0, (12, 200, 3))).reshape(-1, 3))
    done = _scanlock("register", tmp_path / "posts.npy", folder / "target.ply")
    assert (done.returncode, done.stderr) == (2, "")
    assert not done.stdout.startswith("ok")
    done = _scanlock("register", folder / "sources.ply", folder / "target.ply")
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.endswith("; did you mean source.ply?\n")


@pytest.mark.data
def test_two_scans_of_a_real_drive_are_registered(scan_data, tmp_path):
    drive = scan_data / "kitti_drive_0005"
    scans = [drive / f"velodyne_points/data/{number:010d}.bin" for number in (10, 0)]
    picture, pose = tmp_path / "pair.png", tmp_path / "pose.txt"
    done = _scanlock("register", *scans, "-o", pose, "--picture", picture)
    assert (done.returncode, done.stderr) == (0, "")
    chain = [Pose.from_matrix(row.reshape(3, 4)) for row in
             np.loadtxt(drive / "consensus_chain.txt")]  # fmt: skip
    metres, radians = read_pose(pose).distance(chain[0].inverse() @ chain[10])
    assert metres < 0.2
    assert np.degrees(radians) < 0.7
    assert picture.stat().st_size > 50_000
