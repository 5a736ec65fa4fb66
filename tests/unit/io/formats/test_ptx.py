import numpy as np
import pytest

from scanlock.errors import FormatError, InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.io import ScanFile, read_scan, read_scans, write_scan, write_scans

_HEAD = """2
3
10 20 30
0 1 0
-1 0 0
0 0 1
0 1 0 0
-1 0 0 0
0 0 1 0
10 20 30 1
"""
_ROWS = """1 2 3 0.5 10 20 30
0 0 0 0 0 0 0
4 5 6 0.25 40 50 255
7 8 9 0.5 1 2 3
0 0 0 0.5 0 0 0
-1 -2 -3 1 0 0 0
"""
_POSE = Pose([[0, -1, 0], [1, 0, 0], [0, 0, 1]], [10.0, 20.0, 30.0])


def test_a_station_is_read_in_its_own_frame_with_its_grid(save):
    scan = read_scan(save("a.ptx", _HEAD + _ROWS))
    assert scan.points.tolist()[:3] == [[1, 2, 3], [0, 0, 0], [4, 5, 6]]
    assert scan.file_from_station.is_close(_POSE, translation=0, rotation=1e-15)
    # The vector (1, 2, 3) times the rows of the matrix.
    assert (scan.file_from_station @ scan.points[0]).tolist() == [8, 21, 33]
    assert scan.fields["column"].tolist() == [0, 0, 0, 1, 1, 1]
    assert scan.fields["row"].tolist() == [0, 1, 2, 0, 1, 2]
    assert scan.fields["intensity"].tolist() == [0.5, 0, 0.25, 0.5, 0.5, 1]
    assert scan.fields["blue"].tolist() == [30, 0, 255, 3, 0, 0]
    assert scan.fields["blue"].dtype == np.uint8
    assert scan.viewpoint is None


def test_several_stations_are_chosen_by_number(save):
    other = _HEAD.replace("10 20 30", "1 2 3").replace("2\n3", "1\n6", 1)
    path = save("a.ptx", _HEAD + _ROWS + other + _ROWS + "\n")
    with pytest.raises(FormatError, match=r"found 2 stations: 1 \(6 points\), 2 \(6 points\)"):
        read_scan(path)
    first, second = read_scans(path)
    assert first.file_from_station.translation.tolist() == [10, 20, 30]
    assert second.file_from_station.translation.tolist() == [1, 2, 3]
    assert second.fields["row"].tolist() == [0, 1, 2, 3, 4, 5]
    assert np.array_equal(read_scan(f"{path}#2").points, second.points)


def test_rows_without_colours_are_read(save):
    rows = "\n".join(" ".join(line.split()[:4]) for line in _ROWS.splitlines())
    scan = read_scan(save("a.ptx", _HEAD + rows + "\n"))
    assert list(scan.fields) == ["intensity", "column", "row"]
    assert list(read_scan(save("a.ptx", _HEAD + rows + "\n"), columns="x y z").fields) == []


def test_round_trip_of_stations(tmp_path):
    rng = np.random.default_rng(0)
    points = rng.normal(size=(12, 3)) * 20
    points[3] = np.nan
    grid = {"column": np.arange(12) // 5, "row": np.arange(12) % 5}
    fields = {"intensity": rng.random(12), "red": np.arange(12, dtype=np.uint8)}
    fields |= {"green": fields["red"], "blue": fields["red"], **grid}
    pose = Pose.from_step(rng.normal(size=6))
    first = ScanFile(points=points, fields=fields, format="e57", file_from_station=pose)
    second = ScanFile(points=np.nan_to_num(points), fields={}, format="pcd")
    write_scans(tmp_path / "a.ptx", [first, second])
    one, two = read_scans(tmp_path / "a.ptx")
    # Three columns of five rows, of which the last three cells have no point.
    assert len(one) == 15
    assert np.array_equal(one.points[:12], np.nan_to_num(points))
    assert (one.points[12:] == 0).all()
    assert np.array_equal(one.fields["intensity"][:12], fields["intensity"])
    assert np.array_equal(one.fields["green"][:12], fields["green"])
    assert one.file_from_station.is_close(pose, translation=0, rotation=1e-15)
    assert np.array_equal(two.points, second.points)
    assert (two.fields["intensity"] == 0.5).all()
    assert two.file_from_station == Pose.identity()


@pytest.mark.parametrize(
    ("fields", "complaint"),
    [
        ({"time": np.ones(4)}, "fields of PTX must be intensity, and red, green and blue"),
        ({"red": np.ones(4)}, "fields of PTX must be"),
        ({"row": np.zeros(4, int), "column": np.zeros(4, int)}, "a cell of its own"),
        ({"row": np.arange(4) - 1, "column": np.zeros(4, int)}, "a cell of its own"),
        ({"row": np.arange(4), "column": np.arange(4) * 10**6}, "must fill their grid"),
    ],
)
def test_fields_that_ptx_cannot_hold_are_not_written(tmp_path, fields, complaint):
    with pytest.raises(InvalidInput, match=complaint):
        write_scan(tmp_path / "a.ptx", np.ones((4, 3)), fields)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("2\n3\n", "2\n4\n", "line 1: expected 8 lines of points from line 11 on, found .* 6"),
        ("2\n3\n", "0\n3\n", "line 1: expected the number of columns or rows"),
        ("2\n3\n", "2\n" + "9" * 5000 + "\n", "line 2: expected the number of columns or rows"),
        ("2\n3\n", "1\n3\n", "line 14: expected the number of columns or rows"),
        ("0 1 0 0\n", "0 2 0 0\n", "line 7: expected a matrix of a rotation"),
        ("0 1 0 0\n", "0 1 0\n", "line 7: expected 4 numbers"),
        ("-1 0 0\n0 0 1\n", "-1 0\n0 0 1\n", "line 5: expected 3 numbers"),
        ("4 5 6 0.25 40 50 255", "4 5 6 0.25 40 50", "line 13: expected 7 numbers as on line 11"),
        ("4 5 6 0.25 40 50 255", "4 5 six 0.25 40 50 255", "line 13: expected a number"),
        ("4 5 6 0.25 40 50 255", "", "expected 6 lines of numbers, found 1 blank ones"),
    ],
)
def test_malformed_stations_are_refused(save, old, new, complaint):
    assert old in _HEAD + _ROWS
    path = save("a.ptx", (_HEAD + _ROWS).replace(old, new, 1))
    with pytest.raises(FormatError, match=complaint):
        read_scan(path, format="ptx")


def test_truncated_stations_are_refused(save):
    text = _HEAD + _ROWS
    for end in range(1, len(text) - 1):
        try:
            scan = read_scan(save("a.ptx", text[:end]))
        except FormatError:
            continue
        assert len(scan) == 6
        assert "no line end" in scan.notes[0]
