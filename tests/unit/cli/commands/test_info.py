import json

import numpy as np
import pytest

from scanlock.io import CoordinateSystem, ScanFile, describe_scan, write_scan, write_scans


def test_json_equals_the_description(scanlock, scans):
    done = scanlock("info", scans / "invalid_rows.pcd", "--json")
    assert (done.code, done.err) == (0, "")
    assert json.loads(done.out) == json.loads(
        json.dumps(describe_scan(scans / "invalid_rows.pcd").as_dict())
    )


def test_facts_are_printed_before_guesses(scanlock, scans):
    done = scanlock("info", scans / "invalid_rows.pcd")
    lines = done.out.splitlines()
    assert lines[0] == str(scans / "invalid_rows.pcd")
    facts, guesses = done.out.split("guesses\n")
    assert "  points       6,000, 600 columns x 10 rows\n" in facts
    assert "600 with NaN or Inf, 600 at (0, 0, 0)\n" in facts
    assert "  fields       intensity float32, 0 to 5999\n" in facts
    assert "sensor" in guesses
    assert "max range" not in guesses
    assert max(map(len, lines[1:])) <= 80


def test_stations_are_listed_and_one_is_described(scanlock, tmp_path):
    path = tmp_path / "site.ptx"
    write_scans(path, [ScanFile(points=np.ones((k, 3)), fields={}, format="ptx") for k in (4, 7)])
    done = scanlock("info", path)
    rows = [line.split() for line in done.out.splitlines()]
    assert (done.code, rows[0]) == (0, [str(path)])
    assert rows[2:4] == [["1", "4"], ["2", "7"]]
    assert rows[4][-1] == f"{path}#1"
    listed = json.loads(scanlock("info", path, "--json").out)["stations"]
    assert listed == [
        {"number": 1, "name": "", "points": 4},
        {"number": 2, "name": "", "points": 7},
    ]
    assert "points       7" in scanlock("info", f"{path}#2").out


def test_column_names_can_be_given(scanlock, scans):
    done = scanlock("info", scans / "float32.bin", "--columns", "x y z", "--json")
    assert (json.loads(done.out)["points"], json.loads(done.out)["fields"]) == (6000, [])
    assert scanlock("info", scans / "float32.bin", "--columns", "x y").code == 1


def test_long_lists_of_fields_are_truncated(scanlock, tmp_path):
    points = np.random.default_rng(0).normal(size=(50, 3))
    fields = {f"field_{k}": np.full(50, np.nan) for k in range(30)}
    write_scan(tmp_path / "wide.ply", points, fields)
    out = scanlock("info", tmp_path / "wide.ply").out
    assert "field_23 float64\n" in out
    assert "field_24" not in out
    assert "and 6 more\n" in out


def test_map_coordinates_and_times_are_printed(scanlock, tmp_path):
    points = np.random.default_rng(0).uniform([4e5, 5e6, 0.0], [4e5 + 30, 5e6 + 30, 30], (500, 3))
    fields = {"ring": np.arange(500) % 16, "time": np.linspace(0.0, 0.1, 500)}
    write_scan(tmp_path / "far.ply", points, fields)
    text = " ".join(scanlock("info", tmp_path / "far.ply").out.split())
    assert "map coordinates: (40001" in text
    assert "rings 16 in ring" in text
    assert "time time in s, over 0.1 s" in text


def test_a_question_on_the_unit_comes_first(scanlock, scans, tmp_path):
    np.save(tmp_path / "mm.npy", 1000 * np.load(scans / "target.npy"))
    done = scanlock("info", tmp_path / "mm.npy")
    assert done.out.startswith("are these millimetres?  half of the points")
    assert "map coordinates" not in done.out
    metres = scanlock("info", tmp_path / "mm.npy", "--scale", 0.001)
    assert metres.out.startswith(str(tmp_path / "mm.npy"))
    assert "read in units of 0.001 m, as asked" in metres.out
    assert scanlock("info", tmp_path / "mm.npy", "--scale", 0).err == (
        "scanlock: scale must be positive, got 0.0 m\n"
    )


def test_system_and_unit_of_las_are_printed(scanlock, scans, tmp_path):
    pytest.importorskip("laspy")
    feet = CoordinateSystem.from_wkt('PROJCS["site",UNIT["foot",0.3048],AUTHORITY["EPSG","2994"]]')
    points = np.load(scans / "target.npy") + np.array([2e5, 3e5, 0.0])
    write_scan(tmp_path / "a.las", ScanFile(points=points, fields={}, format="las", crs=feet))
    text = " ".join(scanlock("info", tmp_path / "a.las").out.split())
    assert "LAS 1.4, point format 6" in text
    assert "stored in steps of 0.0001 from" in text
    assert "system site, EPSG:2994 unit foot" in text
    assert "range" not in text
    assert "extent" in text
    assert "converted to metres from foot (0.3048 m)" in text
    degrees = CoordinateSystem.from_wkt('GEOGCS["WGS 84",UNIT["degree",0.0174532925199433]]')
    points = np.random.default_rng(0).random((50, 3)) + np.array([11.5, 48.1, 500.0])
    write_scan(tmp_path / "b.las", ScanFile(points=points, fields={}, format="las", crs=degrees))
    text = scanlock("info", tmp_path / "b.las").out
    assert " deg\n" in text
    assert "spacing" not in text
    for command in ("segment", "crispness"):
        done = scanlock(command, tmp_path / "b.las")
        assert done.code == 1
        assert "longitude and latitude in degrees (WGS 84); project" in done.err
