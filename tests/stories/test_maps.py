"""A drive and the stations of a survey become maps, with an interrupt and its continuation."""

import csv

import numpy as np
import pytest

from reference.samples import yaw_pose
from scanlock.cli import main
from scanlock.io import read_kitti_poses, read_scan, write_scan

pytestmark = [pytest.mark.slow, pytest.mark.data]


def _run(*arguments):
    return main([str(argument) for argument in arguments])


def test_a_drive_is_continued_and_its_map_has_intensity_and_scan_numbers(
    scan_data, tmp_path, capsys
):
    drive, whole, broken = scan_data / "kitti_drive_0005", tmp_path / "whole", tmp_path / "broken"
    assert _run("map", drive, "-o", whole, "--scans", 8, "--threads", 2) == 0
    assert _run("map", drive, "-o", broken, "--scans", 5) == 0
    assert _run("map", drive, "-o", broken, "--scans", 8, "--resume") == 0
    for name in ("map.ply", "trajectory_kitti.txt", "trajectory_tum.txt", "map.png"):
        assert (whole / name).read_bytes() == (broken / name).read_bytes()
    found = read_scan(whole / "map.ply")
    assert set(found.fields["scan"].tolist()) == set(range(8))
    assert 0.0 <= found.fields["intensity"].min() < found.fields["intensity"].max() <= 1.0
    with (whole / "pairs.csv").open(newline="") as handle:
        rows = list(csv.DictReader(handle))
    assert all(float(row["probability"]) > 0.9 for row in rows)
    assert all(0.0 < float(row["milliseconds"]) < 60_000.0 for row in rows)
    capsys.readouterr()
    assert _run("crispness", whole / "map.ply", broken / "map.ply") == 0
    assert _run("map", drive, "-o", tmp_path / "few", "--scans", 3) == 0
    assert _run("crispness", whole / "map.ply", tmp_path / "few" / "map.ply") == 1
    assert "got 8 scans" in capsys.readouterr().err


@pytest.mark.parametrize("ending", ["laz", "npz"])
def test_stations_in_map_coordinates_are_aligned_in_the_order_of_their_names(
    scan_data, tmp_path, ending
):
    if ending == "laz":
        pytest.importorskip("laspy")
    plot = read_scan(scan_data / "formats" / "las" / "pine_plot.laz").points
    corner = np.array([500_000.0, 5_400_000.0, 100.0])
    local = plot - plot.mean(axis=0)
    part = np.random.default_rng(0).integers(0, 3, len(local))
    moves = [yaw_pose(0.02 * k, (0.3 * k, -0.2 * k, 0.05 * k)) for k in range(3)]
    folder, out = tmp_path / "stations", tmp_path / "out"
    folder.mkdir()
    for k, move in enumerate(moves):
        write_scan(folder / f"station{k + 9}.{ending}", move.apply(local[part == k]) + corner)
    assert _run("map", folder, "-o", out, "--map-format", ending) == 0
    poses = read_kitti_poses(out / "trajectory_kitti.txt")
    for k, (move, pose) in enumerate(zip(moves, poses, strict=True)):
        landed = pose.apply(move.apply(local[part == k]) + corner) - corner
        assert np.linalg.norm(landed - local[part == k], axis=1).max() < 0.03
    found = read_scan(out / f"map.{ending}").points - corner
    assert np.abs(found).max() < np.abs(local).max() + 0.1
