import json

import numba
import numpy as np
import pytest

from scanlock.io import read_kitti_poses, read_labels, read_scan, read_tum_poses
from scanlock.simulation import SurfaceClass

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        numba.config.DISABLE_JIT, reason="simulating without a compiler takes minutes"
    ),
]


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """Two scans of the forest, made through the command line."""
    from scanlock.cli import main

    folder = tmp_path_factory.mktemp("drive") / "new"
    arguments = ["--scans", "2", "--every", "20", "--sensor", "hdl-32e", "--format", "ply"]
    assert main(["simulate", "forest", "-o", str(folder), *arguments]) == 0
    return folder


def test_scans_labels_and_poses_are_consistent(drive):
    assert sorted(path.name for path in (drive / "scans").iterdir()) == [
        "000000.ply",
        "000001.ply",
    ]
    poses = read_kitti_poses(drive / "poses_kitti.txt")
    times, same = read_tum_poses(drive / "poses_tum.txt")
    assert len(poses) == len(same) == 2
    assert times[1] - times[0] == pytest.approx(2.0)
    for one, other in zip(poses, same, strict=True):
        assert one.is_close(other, translation=1e-12, rotation=1e-12)
    for number in range(2):
        scan = read_scan(drive / "scans" / f"{number:06d}.ply")
        labels = read_labels(drive / "labels" / f"{number:06d}.npy", count=len(scan))
        assert {"ring", "time"} == set(scan.fields)
        assert {SurfaceClass.GROUND, SurfaceClass.TRUNK} <= set(labels.tolist())
        # The sensor is about a metre above the ground.
        ground = scan.points[labels == SurfaceClass.GROUND]
        near = ground[np.hypot(ground[:, 0], ground[:, 1]) < 4.0]
        assert -1.4 < np.median(near[:, 2]) < -0.6


def test_poses_align_the_scans(drive):
    from scipy.spatial import cKDTree

    poses = read_kitti_poses(drive / "poses_kitti.txt")
    first, second = (
        pose.apply(read_scan(drive / "scans" / f"{number:06d}.ply").points)
        for number, pose in enumerate(poses)
    )
    labels = read_labels(drive / "labels" / "000001.npy")
    trunks = second[(labels == SurfaceClass.TRUNK)]
    # Points of a trunk in both scans are as close as the beams, a few per metre.
    distances, _ = cKDTree(first).query(trunks)
    assert np.median(distances) < 0.25
    unmoved = read_scan(drive / "scans" / "000001.ply").points[labels == SurfaceClass.TRUNK]
    wrong, _ = cKDTree(read_scan(drive / "scans" / "000000.ply").points).query(unmoved)
    assert np.median(wrong) > 2.0 * np.median(distances)


def test_scans_of_a_facet_ladar_are_in_the_frame_of_the_vehicle(scanlock, tmp_path):
    folder = tmp_path / "run"
    options = ["--sensor", "facet-ladar", "--scans", "2", "--format", "ply"]
    assert scanlock("simulate", "rugged", "-o", folder, *options).code == 0
    times, poses = read_tum_poses(folder / "poses_tum.txt")
    assert times[1] - times[0] == pytest.approx(0.1)
    metres, _ = poses[0].distance(poses[1])
    assert metres == pytest.approx(0.56, rel=0.3)
    for number in range(2):
        scan = read_scan(folder / "scans" / f"{number:06d}.ply")
        labels = read_labels(folder / "labels" / f"{number:06d}.npy", count=len(scan))
        assert 3000 < len(scan) < 5760
        assert (labels == SurfaceClass.GROUND).mean() > 0.2
        # The field of view is ahead of the vehicle, with its frame 1.5 m above the ground.
        assert scan.points[:, 0].min() > 1.0
        assert scan.fields["ring"].max() < 32
        ground = scan.points[labels == SurfaceClass.GROUND]
        nearest = ground[np.argsort(ground[:, 0])[:100]]
        assert np.median(nearest[:, 2]) == pytest.approx(-1.5, abs=0.8)


def test_settings_describe_generation_and_conventions(drive):
    content = json.loads((drive / "settings.json").read_text())
    assert content["settings"] == {
        "scene": "forest",
        "sensor": "hdl-32e",
        "scans": 2,
        "every": 20,
        "seed": 1,
        "format": "ply",
        "motion": "removed",
    }
    assert content["classes"]["ground"] == SurfaceClass.GROUND
    assert "world_from_sensor" in content["conventions"]["poses"]


def test_a_folder_with_scans_is_not_overwritten(scanlock, drive):
    before = (drive / "settings.json").stat().st_mtime_ns
    done = scanlock("simulate", "forest", "-o", drive)
    assert (done.code, done.out) == (1, "")
    assert "contains scans already" in done.err
    assert (drive / "settings.json").stat().st_mtime_ns == before


@pytest.mark.parametrize("option", ["--scans", "--every", "--seed"])
def test_counts_must_be_whole_numbers(scanlock, tmp_path, option):
    done = scanlock("simulate", "street", "-o", tmp_path / "new", option, "-1")
    assert done.code == 1
    assert f"{option} must be a whole number" in done.err
    assert not (tmp_path / "new").exists()


def test_an_interrupted_run_leaves_a_pose_for_each_scan(scanlock, tmp_path, monkeypatch):
    from scanlock.cli.commands import simulate
    from scanlock.geometry.pose import Pose
    from scanlock.simulation import CAR, Drive, SimulatedSequence, World, boxes, hdl_32e

    world = World.of([boxes([[8.0, 0.0, 0.0]], [[1.0, 5.0, 5.0]], SurfaceClass.BUILDING)])

    class Interrupted(SimulatedSequence):
        def __getitem__(self, index):
            if index == 2:
                raise KeyboardInterrupt
            return super().__getitem__(index)

    poses = tuple(Pose(np.eye(3), np.array([0.1 * k, 0.0, 0.0])) for k in range(4))
    drive = Drive(poses, np.zeros((4, 6)), np.arange(4) / CAR.speed)
    sequence = Interrupted(world=world, sensor=hdl_32e(), drive=drive, seed=0)
    monkeypatch.setattr(simulate, "_sequence", lambda *_: sequence)
    done = scanlock("simulate", "street", "-o", tmp_path, "--scans", "4", "--motion", "kept")
    assert (done.code, done.out, done.err) == (130, "", "")
    assert len(read_kitti_poses(tmp_path / "poses_kitti.txt")) == 2
    assert len(list((tmp_path / "scans").iterdir())) == 2
    # Readers of KITTI expect four columns.
    scan = read_scan(tmp_path / "scans" / "000000.bin")
    assert not scan.fields["intensity"].any()
