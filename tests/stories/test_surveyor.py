"""A pair of survey files in feet: described, registered, written in feet again, and classified."""

import json

import numpy as np
import pytest

from reference.samples import street, yaw_pose
from scanlock.cli import main
from scanlock.io import read_scan

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
def pair(tmp_path):
    target = _write(tmp_path / "target.laz", street(1))
    return _write(tmp_path / "source.laz", _MOTION.inverse().apply(street(2))), target


def _run(capsys, *arguments):
    code = main([str(argument) for argument in arguments])
    return code, capsys.readouterr().out


def test_a_pair_in_feet_is_registered_and_written_in_feet(pair, tmp_path, capsys):
    source, target = pair
    code, out = _run(capsys, "info", source)
    assert code == 0
    assert "EPSG:2992, EPSG:8228" in out
    assert "foot" in out
    code, out = _run(
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
    code, _ = _run(capsys, "segment", pair[1], "-o", tmp_path / "classified.laz")
    assert code == 0
    after = laspy.read(tmp_path / "classified.laz")
    ground = np.asarray(after.classification) == 2
    assert np.array_equal(ground, np.asarray(after.label) == 0)
    assert np.std(np.asarray(after.z)[ground]) * _FOOT < 0.3
    assert np.array_equal(after.X, laspy.read(pair[1]).X)
