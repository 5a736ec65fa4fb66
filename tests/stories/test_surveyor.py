"""The work of a surveyor: epochs in LAS, stations in E57, and the coordinates kept."""

import json
import math
import re

import numpy as np
import pytest

import scanlock
from reference.samples import street, yaw_pose
from scanlock.cli import main
from scanlock.geometry.rotations import quaternion_from_rotation
from scanlock.io import read_kitti_poses, read_scan, write_scan

laspy = pytest.importorskip("laspy")

pytestmark = pytest.mark.slow

_FOOT = 0.3048
_CORNER = np.array([2.1e6, 6.2e5, 300.0]) * _FOOT
_WKT = (
    'COMPD_CS["Oregon + height",PROJCS["Oregon GIC Lambert (ft)",UNIT["foot",0.3048],'
    'AUTHORITY["EPSG","2992"]],VERT_CS["NAVD88 height (ft)",UNIT["foot",0.3048],'
    'AUTHORITY["EPSG","8228"]]]'
)
_MOTION = yaw_pose(0.05, (0.8, -0.5, 0.1))
_BETWEEN = yaw_pose(0.4, (6.0, -2.0, 0.1))
_YARD = yaw_pose(-1.2, (120.0, 40.0, 3.0))
_CHANGE = yaw_pose(math.radians(1.5), (2.0, -1.1, 0.2))


def _run(capsys, *arguments):
    code = main([str(argument) for argument in arguments])
    done = capsys.readouterr()
    return code, done.out, done.err


def _write(path, points):
    """Write points in metres as LAS 1.4 in feet, with a record that no program knows."""
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.scales, header.offsets = [0.001] * 3, [2.1e6, 6.2e5, 0.0]
    header.global_encoding.wkt = True
    header.vlrs.append(laspy.VLR("LASF_Projection", 2112, "", _WKT.encode() + b"\0"))
    header.vlrs.append(laspy.VLR("survey office", 7, "job", b"4711"))
    las = laspy.LasData(header)
    las.x, las.y, las.z = ((points + _CORNER) / _FOOT).T
    las.intensity = np.arange(len(points)) % 1000
    las.write(path)
    return path


@pytest.fixture
def epochs(scan_data, tmp_path):
    """Return two files of laspy: every other point of a flight, the second half moved."""
    flight = laspy.read(scan_data / "formats" / "las" / "MixedConifer.laz")
    middle = np.round(flight.xyz.mean(axis=0))
    paths = [tmp_path / "epoch1.laz", tmp_path / "epoch2.laz"]
    for k, path in enumerate(paths):
        part = laspy.LasData(flight.header, flight.points[k::2].copy())
        points = np.array(part.xyz) - middle
        moved = (_CHANGE.inverse().apply(points) if k else points) + middle
        part.x, part.y, part.z = moved.T
        part.write(path)
    return *paths, np.array(flight.xyz)[1::2]


def _projection(las):
    """Return the records of the coordinate system."""
    records = (one for one in las.header.vlrs if one.user_id == "LASF_Projection")
    return {one.record_id: one.record_data_bytes() for one in records}


@pytest.mark.data
def test_two_epochs_of_a_flight_are_aligned_merged_and_reported(epochs, tmp_path, capsys):
    target, source, truth = epochs
    code, out, _ = _run(capsys, "info", source)
    assert code == 0
    assert re.search(r"LAS +1\.2, point format 1\n", out)
    assert re.search(r"system +EPSG:26912\n +unit +metre\n", out)
    assert re.search(r"origin +map coordinates: \(481\d{3}, 3812\d{3}, \d+\) m is sub", out)

    names = ("pose.txt", "moved.laz", "both.laz", "page.html")
    pose, moved, both, page = (tmp_path / name for name in names)
    code, out, _ = _run(
        capsys, "register", source, target, "-o", pose, "--aligned", moved, "--merged", both,
        "--report", page,
    )  # fmt: skip
    assert code == 0
    text = " ".join(out.split())
    accuracy = re.search(r"right with 9\d\.\d%; [\d.]+ mm and 0\.0\d+ deg at one sigma, "
                         r"weakest (?:east|north|up), ([\d.]+) mm", text)  # fmt: skip
    assert 1 < float(accuracy[1]) < 50
    assert "along x, y, z at the centroid, 481" in text
    # The matrix is printed as CloudCompare takes it: four lines of four numbers, in full.
    matrix = np.array([line.split() for line in out.split("[m]:\n")[1].splitlines()[:4]], float)
    assert np.array_equal(matrix, np.loadtxt(pose))

    before, after = laspy.read(source), laspy.read(moved)
    assert np.abs(np.array(after.xyz) - truth).max() < 0.03
    assert (after.header.version, after.header.point_format.id) == (before.header.version, 1)
    assert set(_projection(after)) == {34735}
    assert _projection(after) == _projection(before)
    kept = set(before.point_format.dimension_names) - {"X", "Y", "Z"}
    assert "treeID" in kept
    assert all(np.array_equal(after[name], before[name]) for name in kept)
    merged = laspy.read(both)
    assert np.array_equal(np.bincount(merged["scan"]), [len(laspy.read(target)), len(after)])
    assert {"red", "green", "blue", "treeID"} <= set(merged.point_format.dimension_names)
    assert _projection(merged) == _projection(before)

    html = page.read_text("utf-8")
    assert "epoch2.laz onto epoch1.laz" in html
    assert accuracy[0] in html
    assert html.count("EPSG 26912") == 2
    assert html.count("src='data:image/png;base64,") == 2
    assert "src='http" not in html

    again = tmp_path / "again.laz"
    assert _run(capsys, "apply", pose, source, "-o", again)[0] == 0
    assert again.read_bytes() == moved.read_bytes()


@pytest.mark.data
def test_a_failed_registration_leaves_no_pose_and_no_cloud_to_take_for_good(
    epochs, tmp_path, capsys
):
    low, high = (481_290.0, 3_812_950.0, 0.0), (481_320.0, 3_812_980.0, 30.0)
    points = np.random.default_rng(0).uniform(low, high, (3000, 3))
    write_scan(tmp_path / "posts.laz", points)
    pose, moved = tmp_path / "pose.txt", tmp_path / "moved.laz"
    code, out, _ = _run(
        capsys, "register", tmp_path / "posts.laz", epochs[0], "-o", pose, "--aligned", moved
    )
    assert code == 2
    assert not out.startswith("ok")
    told = " ".join(out.split())
    assert "pose.txt (it says that the pose is not verified)" in told
    assert "moved.laz: the pose is not verified (unverified); --force writes it" in told
    assert not moved.exists()
    code, _, err = _run(capsys, "apply", pose, tmp_path / "posts.laz", "-o", moved)
    assert (code, moved.exists()) == (1, False)
    assert "--force" in err


@pytest.fixture
def pair(tmp_path):
    target = _write(tmp_path / "target.laz", street(1))
    return _write(tmp_path / "source.laz", _MOTION.inverse().apply(street(2))), target


def test_a_pair_in_feet_is_registered_and_written_in_feet(pair, tmp_path, capsys):
    source, target = pair
    code, out, _ = _run(capsys, "info", source)
    assert code == 0
    assert "EPSG:2992, EPSG:8228" in out
    assert "foot" in out
    code, out, _ = _run(
        capsys, "register", source, target, "--json", "--aligned", tmp_path / "moved.laz"
    )
    assert code == 0
    notes = json.loads(out)["notes"]
    assert any(
        note.startswith("source: converted to metres") and note.endswith("the pose is in metres")
        for note in notes
    )
    # Metres at the centroid, not feet.
    shift = json.loads(out)["centroid_shift_m"]
    expected = (street(2) - _MOTION.inverse().apply(street(2))).mean(axis=0)
    assert np.abs(np.array(shift) - expected).max() < 0.03
    before, after = laspy.read(source), laspy.read(tmp_path / "moved.laz")
    assert [one.record_id for one in after.header.vlrs] == [2112, 7]
    assert after.header.vlrs[0].string == _WKT
    assert after.header.global_encoding.wkt
    assert np.array_equal(after.intensity, before.intensity)
    moved = np.stack([after.x, after.y, after.z], axis=1) * _FOOT - _CORNER
    assert np.abs(moved - street(2)).max() < 0.03
    assert read_scan(tmp_path / "moved.laz").crs == read_scan(target).crs


def test_a_scan_in_feet_is_classified(pair, tmp_path, capsys):
    code, _, _ = _run(capsys, "segment", pair[1], "-o", tmp_path / "classified.laz")
    assert code == 0
    after = laspy.read(tmp_path / "classified.laz")
    ground = np.asarray(after.classification) == 2
    assert np.array_equal(ground, np.asarray(after.label) == 0)
    assert np.std(np.asarray(after.z)[ground]) * _FOOT < 0.3
    assert np.array_equal(after.X, laspy.read(pair[1]).X)


@pytest.fixture
def site(tmp_path):
    """Return a file of two stations, of which the second has no pose to rely on."""
    pye57 = pytest.importorskip("pye57")
    path = tmp_path / "site.e57"
    stations = {"Yard": (street(1), _YARD), "Hall": (_BETWEEN.inverse().apply(street(2)), _YARD)}
    with pye57.E57(str(path), mode="w") as file:
        for name, (points, pose) in stations.items():
            file.write_scan_raw(
                {f"cartesian{axis}": points[:, k] for k, axis in enumerate("XYZ")},
                name=name,
                rotation=quaternion_from_rotation(pose.rotation),
                translation=pose.translation,
            )
    return path


def test_a_station_is_registered_and_its_pose_written_into_the_file(site, tmp_path, capsys):
    code, out, _ = _run(capsys, "info", site)
    assert code == 0
    assert re.search(r"1 +Yard +[\d,]+\n +2 +Hall +", out)
    code, out, _ = _run(capsys, "info", f"{site}#Yard")
    assert code == 0
    assert "at (120.000, 40.000, 3.000) m in the file, rotated by 68.75 deg" in out

    moved = tmp_path / "moved.e57"
    code, out, _ = _run(
        capsys, "register", f"{site}#Hall", f"{site}#1", "--json", "--aligned", moved
    )
    assert code == 0
    pose = scanlock.Pose.from_matrix(json.loads(out)["target_from_source"])
    assert pose.is_close(_BETWEEN, translation=0.1, rotation=math.radians(0.3))
    aligned, source = scanlock.read_scan(moved), scanlock.read_scan(site, station="Hall")
    assert np.abs(aligned.points - pose @ source.points).max() < 1e-4
    code, _, err = _run(capsys, "register", f"{site}#2", f"{site}#1", "--aligned", site)
    assert code == 1
    assert "is an input file and would be overwritten" in err

    target = scanlock.read_scan(site, station=1)
    new = target.file_from_station @ pose
    scanlock.write_e57_poses(site, tmp_path / "aligned.e57", [None, new])
    yard, hall = (
        scanlock.transform_scan(scan, scan.file_from_station)
        for scan in scanlock.read_scans(tmp_path / "aligned.e57")
    )
    # Both stations have the ground at one height in the frame of the file.
    heights = [
        np.median(scan.points[scanlock.segment(scan.points - [120, 40, 3]).is_ground, 2])
        for scan in (yard, hall)
    ]
    assert abs(heights[1] - heights[0]) < 0.1
    pye57 = pytest.importorskip("pye57")
    with pye57.E57(str(tmp_path / "aligned.e57")) as file:
        data = file.read_scan(1, ignore_missing_fields=True)
    theirs = np.stack([data[f"cartesian{axis}"] for axis in "XYZ"], axis=1)
    assert np.abs(hall.points - theirs).max() < 1e-6


def test_the_stations_of_a_file_are_mapped_and_get_their_poses(site, tmp_path, capsys):
    out, aligned = tmp_path / "out", tmp_path / "aligned.e57"
    code, text, _ = _run(capsys, "map", site, "-o", out)
    assert code == 0
    assert "1 of 1 pairs are verified" in text
    assert "1,site#Hall," in (out / "scans.csv").read_text()
    first = scanlock.read_scan(site, station="Yard").file_from_station
    poses = [first @ pose for pose in read_kitti_poses(out / "trajectory_kitti.txt")]
    scanlock.write_e57_poses(site, aligned, poses)
    pye57 = pytest.importorskip("pye57")
    with pye57.E57(str(aligned)) as file:
        found = [file.get_header(k) for k in range(file.scan_count)]
        found = [scanlock.Pose(one.rotation_matrix, one.translation) for one in found]
    assert found[0].is_close(_YARD, translation=1e-9, rotation=1e-7)
    assert found[1].is_close(_YARD @ _BETWEEN, translation=0.1, rotation=math.radians(0.3))


@pytest.mark.parametrize("ending", ["laz", "npz"])
@pytest.mark.data
def test_stations_in_map_coordinates_are_aligned_in_the_order_of_their_names(
    scan_data, tmp_path, capsys, ending
):
    plot = read_scan(scan_data / "formats" / "las" / "pine_plot.laz").points
    corner = np.array([500_000.0, 5_400_000.0, 100.0])
    local = plot - plot.mean(axis=0)
    part = np.random.default_rng(0).integers(0, 3, len(local))
    moves = [yaw_pose(0.02 * k, (0.3 * k, -0.2 * k, 0.05 * k)) for k in range(3)]
    folder, out = tmp_path / "stations", tmp_path / "out"
    folder.mkdir()
    for k, move in enumerate(moves):
        write_scan(folder / f"station{k + 9}.{ending}", move.apply(local[part == k]) + corner)
    assert _run(capsys, "map", folder, "-o", out, "--map-format", ending)[0] == 0
    poses = read_kitti_poses(out / "trajectory_kitti.txt")
    for k, (move, pose) in enumerate(zip(moves, poses, strict=True)):
        landed = pose.apply(move.apply(local[part == k]) + corner) - corner
        assert np.linalg.norm(landed - local[part == k], axis=1).max() < 0.03
    found = read_scan(out / f"map.{ending}").points - corner
    assert np.abs(found).max() < np.abs(local).max() + 0.1
