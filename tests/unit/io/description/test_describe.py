import json
import math

import numpy as np
import pytest

from scanlock.errors import FormatError
from scanlock.io import CoordinateSystem, ScanFile, describe_scan, write_scan
from scanlock.io.description.guesses import guess_sensor, guess_time


def _describe(tmp_path, points, fields=None, **options):
    write_scan(tmp_path / "a.pcd", points, fields, **options)
    return describe_scan(tmp_path / "a.pcd")


def test_points_and_columns_are_counted(tmp_path, room_scan):
    points = room_scan(beams=8, steps=100)[:792]
    points[10] = np.nan
    points[11, 2] = np.inf
    points[20:30] = 0.0
    points[30] = -0.0
    points[40:43] = points[50]
    points[60] = points[61]
    fields = {"ring": np.repeat(np.arange(8), 100)[:792], "intensity": np.full(792, np.nan)}
    found = _describe(tmp_path, points, fields, height=8)
    assert (found.format, found.encoding, found.coordinate_dtype) == ("pcd", "binary", "float64")
    assert (found.points, found.width, found.height) == (792, 99, 8)
    assert found.size == (tmp_path / "a.pcd").stat().st_size
    assert (found.not_finite, found.zeros, found.duplicates) == (2, 11, 4)
    assert (found.ring_field, found.rings) == ("ring", 8)
    usable = points[np.isfinite(points).all(1) & (points != 0).any(1)]
    assert found.minimum == tuple(usable.min(0))
    assert found.maximum == tuple(usable.max(0))
    ranges = np.hypot(usable[:, 0], usable[:, 1])
    assert found.median_range == pytest.approx(np.median(ranges))
    assert found.max_range == pytest.approx(ranges.max())
    distinct = np.unique(usable, axis=0)
    distances = np.linalg.norm(distinct[:, None] - distinct, axis=2)
    distances += np.diag([np.inf] * len(distinct))
    assert found.spacing == pytest.approx(np.median(distances.min(1)))
    assert not found.large_coordinates
    assert [field.name for field in found.fields] == ["ring", "intensity"]
    assert (found.fields[0].minimum, found.fields[0].maximum) == (0, 7)
    assert math.isnan(found.fields[1].minimum)


def test_guesses_are_a_separate_object_in_json(tmp_path, room_scan):
    fields = {"time": np.linspace(0, 0.1, 5760), "n": np.full((5760, 2), np.nan)}
    found = _describe(tmp_path, room_scan(), fields).as_dict()
    again = json.loads(json.dumps(found, allow_nan=False))
    assert again == found
    assert set(again["guesses"]) == {"sensor", "time"}
    assert not {"sensor", "unit"} & set(again)
    assert again["guesses"]["time"]["unit"] == "s"
    assert again["fields"][1] == {
        "name": "n",
        "dtype": "float64",
        "values": 2,
        "minimum": None,
        "maximum": None,
    }


def test_map_coordinates_are_detected_and_given_an_origin(tmp_path, room_scan):
    origin = np.array([512_345.0, 5_403_210.0, 120.0])
    near, far = room_scan(), room_scan() + origin
    found = _describe(tmp_path, far)
    assert found.large_coordinates
    assert math.isnan(found.median_range)
    assert found.as_dict()["max_range"] is None
    assert np.abs(np.array(found.origin) - origin).max() < 20
    assert found.spacing == pytest.approx(_describe(tmp_path, near).spacing, rel=1e-4)
    write_scan(tmp_path / "b.pcd", far.astype(np.float32))
    assert any(
        "float32 rounds these coordinates" in note
        for note in describe_scan(tmp_path / "b.pcd").notes
    )
    assert _describe(tmp_path, near.astype(np.float32)).notes == ()


def test_few_whole_numbers_in_a_fourth_column_are_noted_as_possible_labels(tmp_path, room_scan):
    points = room_scan().astype(np.float32)
    write_scan(tmp_path / "a.bin", points, {"intensity": np.arange(5760) % 3})
    assert "labels rather than intensities" in describe_scan(tmp_path / "a.bin").notes[-1]
    write_scan(tmp_path / "a.bin", points, {"intensity": np.random.default_rng(0).random(5760)})
    assert "labels" not in " ".join(describe_scan(tmp_path / "a.bin").notes)


def test_a_scan_without_a_usable_point_is_an_error(tmp_path):
    points = np.zeros((5, 3))
    points[1] = np.nan
    with pytest.raises(FormatError, match="1 rows with NaN or Inf and 4 of zeros"):
        _describe(tmp_path, points)


def test_a_single_point_has_no_spacing(tmp_path):
    found = _describe(tmp_path, np.ones((3, 3)))
    assert (found.duplicates, math.isnan(found.spacing)) == (2, True)


@pytest.mark.parametrize("beams", [8, 16, 32, 64])
@pytest.mark.parametrize("order", ["ring", "column", "shuffled"])
def test_beams_are_counted_in_any_order_of_points(room_scan, beams, order):
    points = room_scan(beams=beams, order=order)
    if order == "shuffled":
        points = np.random.default_rng(0).permutation(points)
    assert guess_sensor(points, None, 1) == f"spinning lidar, about {beams} beams"


def test_ring_numbers_and_rows_give_the_number_of_beams(room_scan):
    points = room_scan()
    assert "about 12 beams" in guess_sensor(points, 12, 1)
    assert "about 24 beams" in guess_sensor(points, None, 24)
    front = points[points[:, 0] > np.abs(points[:, 1])]
    assert guess_sensor(front, 16, 1) == "lidar with about 16 beams, 90 degrees wide"


def test_beams_of_a_moving_sensor_are_counted(room_scan):
    points = room_scan(beams=32, steps=900, order="column")
    tilt = np.linspace(0.0, np.radians(1.0), len(points))
    moved = points.copy()
    moved[:, 0] = points[:, 0] * np.cos(tilt) + points[:, 2] * np.sin(tilt)
    moved[:, 2] = points[:, 2] * np.cos(tilt) - points[:, 0] * np.sin(tilt)
    found = guess_sensor(moved, None, 1)
    assert found.startswith("spinning lidar, about ")
    assert 24 <= int(found.split()[3]) <= 40


def test_map_tiles_and_merged_clouds_are_distinguished():
    rng = np.random.default_rng(4)
    tile = rng.random((20_000, 3)) * [200.0, 200.0, 8.0] - [100.0, 100.0, 4.0]
    assert guess_sensor(tile, None, 1) == "airborne scan or map tile"
    blob = rng.normal(size=(20_000, 3)) * [10.0, 10.0, 2.0]
    assert guess_sensor(blob, None, 1).startswith("scanner away from the origin")
    assert guess_sensor(rng.normal(size=(60, 3)) * 20, None, 1) == "unknown"


@pytest.mark.parametrize(
    ("name", "values", "unit", "span", "clock"),
    [
        ("time", np.linspace(0, 0.0998, 50), "s", 0.0998, "relative"),
        ("t", np.linspace(0, 99.8, 50), "ms", 0.0998, "relative"),
        ("t", np.linspace(0, 99_800, 50), "us", 0.0998, "relative"),
        ("t", np.arange(0, 10**8, 10**6), "ns", 0.099, "relative"),
        ("t", np.arange(0, 100, dtype=np.uint16), "ms", 0.099, "relative"),
        ("timestamp", 1.6e9 + np.linspace(0, 0.0625, 50), "s", 0.0625, "Unix time"),
        ("timestamp", 1.6e15 + np.linspace(0, 65_536, 50), "us", 0.065536, "Unix time"),
        ("t", 1_600_000_000 * 10**9 + np.arange(0, 10**8, 10**7), "ns", 0.09, "Unix time"),
        ("gps_time", 2e5 + np.linspace(0, 2000, 50), "s", 2000, "relative"),
        ("time_ns", np.linspace(0, 5e9, 50), "ns", 5, "relative"),
        ("time", np.linspace(0, 1, 50), "fraction of the sweep", None, "relative"),
        ("time", np.zeros(50), "unknown", None, "relative"),
        ("time", np.full(50, np.nan), "unknown", None, "relative"),
    ],
)
def test_the_unit_of_times_is_guessed(name, values, unit, span, clock):
    found = guess_time(name, values)
    assert (found.unit, found.clock) == (unit, clock)
    assert found.span == (span if span is None else pytest.approx(span, rel=1e-6))


def test_the_column_of_times_is_found_by_its_name(tmp_path, room_scan):
    values = np.linspace(0, 0.1, 5760)
    for name in ("t", "Time", "time_offset", "scalar_GPS_Time", "time_us"):
        assert _describe(tmp_path, room_scan(), {"a": values, name: values}).time_field == name
    assert _describe(tmp_path, room_scan(), {"a_us": values}).time_field is None


@pytest.mark.parametrize("factor", [1000.0, 100_000.0])
def test_millimetres_are_asked_for(tmp_path, room_scan, factor):
    points = room_scan()
    assert _describe(tmp_path, points).questions == ()
    [question] = _describe(tmp_path, factor * points).questions
    assert question.startswith("are these millimetres? ")
    assert "--scale 0.001" in question
    assert describe_scan(tmp_path / "a.pcd", scale=1 / factor).questions == ()


def test_smaller_units_of_a_small_object_are_asked_for(tmp_path):
    ball = np.random.default_rng(0).normal(size=(5000, 3))
    ball *= 300.0 / np.linalg.norm(ball, axis=1, keepdims=True)
    [question] = _describe(tmp_path, ball).questions
    assert question.startswith("are these centimetres or millimetres? ")


def test_terrain_is_not_taken_for_millimetres(tmp_path):
    rng = np.random.default_rng(0)
    terrain = rng.random((20_000, 3)) * [1500.0, 1500.0, 120.0]
    assert _describe(tmp_path, terrain + np.array([4e5, 5e6, 0.0])).questions == ()


def test_a_scan_that_is_too_small_is_asked_about(tmp_path, room_scan):
    [question] = _describe(tmp_path, 1e-4 * room_scan()).questions
    assert question.startswith("which unit is this? ")


_PROJECTED = 'PROJCS["site"{}]'
_DEGREES = 'GEOGCS["WGS 84",UNIT["degree",0.0174532925199433],AUTHORITY["EPSG","4326"]]'


def _with_system(path, points, wkt):
    scan = ScanFile(points=points, fields={}, format="las", crs=CoordinateSystem.from_wkt(wkt))
    write_scan(path, scan)
    return path


def test_feet_are_asked_for_where_the_system_has_no_unit(tmp_path, room_scan):
    pytest.importorskip("laspy")
    path = _with_system(tmp_path / "a.las", room_scan(), _PROJECTED.format(""))
    [question] = describe_scan(path).questions
    assert question.startswith("are these feet? ")
    assert describe_scan(path, scale=0.3048).questions == ()
    path = _with_system(tmp_path / "b.las", room_scan(), _PROJECTED.format(',UNIT["foot",0.3048]'))
    assert describe_scan(path).questions == ()


def test_system_unit_and_header_of_las_are_described(tmp_path, room_scan):
    pytest.importorskip("laspy")
    path = _with_system(
        tmp_path / "a.laz", room_scan(), _PROJECTED.format(',UNIT["ft",0.3048],ID["EPSG",2994]')
    )
    found = json.loads(json.dumps(describe_scan(path).as_dict(), allow_nan=False))
    assert found["system"] == {
        "name": "site",
        "epsg": 2994,
        "vertical_epsg": None,
        "horizontal_unit": "foot",
        "vertical_unit": "foot",
        "is_geographic": False,
    }
    assert found["metres_per_unit"] == [0.3048] * 3
    assert (found["las"]["version"], found["las"]["point_format"]) == ("1.4", 6)
    assert found["las"]["scales"] == [1e-4] * 3
    assert found["las"]["software"] == "scanlock"


def test_degrees_have_no_lengths(tmp_path):
    pytest.importorskip("laspy")
    points = np.random.default_rng(0).random((800, 3)) * [0.01, 0.01, 30] + np.array(
        [11.5, 48.1, 500.0]
    )
    found = describe_scan(_with_system(tmp_path / "a.las", points, _DEGREES))
    assert found.system.is_geographic
    assert math.isnan(found.spacing)
    assert math.isnan(found.median_range)
    assert found.questions == ()
    assert found.guesses.sensor == "unknown"
    assert "degrees" in found.notes[-1]
