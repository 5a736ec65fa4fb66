"""Two stations of one E57 file: chosen, registered, and written back with a new pose."""

import json
import math

import numpy as np
import pytest

import scanlock
from reference.samples import street, yaw_pose
from scanlock.cli import main
from scanlock.geometry.rotations import quaternion_from_rotation

pye57 = pytest.importorskip("pye57")

pytestmark = pytest.mark.slow

_MOTION = yaw_pose(0.4, (6.0, -2.0, 0.1))
_YARD = yaw_pose(-1.2, (120.0, 40.0, 3.0))


@pytest.fixture
def site(tmp_path):
    """Return a file of two stations, of which the second has no pose to rely on."""
    path = tmp_path / "site.e57"
    stations = {"Yard": (street(1), _YARD), "Hall": (_MOTION.inverse().apply(street(2)), _YARD)}
    with pye57.E57(str(path), mode="w") as file:
        for name, (points, pose) in stations.items():
            file.write_scan_raw(
                {f"cartesian{axis}": points[:, k] for k, axis in enumerate("XYZ")},
                name=name,
                rotation=quaternion_from_rotation(pose.rotation),
                translation=pose.translation,
            )
    return path


def _run(capsys, *arguments):
    code = main([str(argument) for argument in arguments])
    done = capsys.readouterr()
    return code, done.out, done.err


def test_a_station_is_registered_and_its_pose_written_into_the_file(site, tmp_path, capsys):
    code, _, err = _run(capsys, "info", site)
    assert code == 1
    assert "found 2 stations: 1 'Yard' (" in err
    code, out, _ = _run(capsys, "info", f"{site}#Yard")
    assert code == 0
    assert "at (120.000, 40.000, 3.000) m in the file, rotated by 68.75 deg" in out

    moved = tmp_path / "moved.e57"
    code, out, _ = _run(
        capsys, "register", f"{site}#Hall", f"{site}#1", "--json", "--aligned", moved
    )
    assert code == 0
    pose = scanlock.Pose.from_matrix(json.loads(out)["target_from_source"])
    assert pose.is_close(_MOTION, translation=0.1, rotation=math.radians(0.3))
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
    with pye57.E57(str(tmp_path / "aligned.e57")) as file:
        data = file.read_scan(1, ignore_missing_fields=True)
    theirs = np.stack([data[f"cartesian{axis}"] for axis in "XYZ"], axis=1)
    assert np.abs(hall.points - theirs).max() < 1e-6
