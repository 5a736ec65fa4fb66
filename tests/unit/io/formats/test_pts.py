import numpy as np
import pytest

from scanlock.errors import FormatError, InvalidInput
from scanlock.io import read_scan, read_scans, write_scan

_COLOURED = "2\n1.5 2 3 -700 10 20 255\n4 5 6 12 0 0 0\n"


def test_intensities_and_colours_are_named(save):
    scan = read_scan(save("a.pts", _COLOURED))
    assert scan.points.tolist() == [[1.5, 2, 3], [4, 5, 6]]
    assert scan.fields["intensity"].tolist() == [-700, 12]
    assert scan.fields["blue"].tolist() == [255, 0]
    assert scan.format == "pts"
    names = {
        "2\n1.5 2 3\n4 5 6\n": [],
        "2\n1.5 2 3 0.5\n4 5 6 0.7\n": ["intensity"],
        "2\n1.5 2 3 1 2 3\n4 5 6 7 8 255\n": ["red", "green", "blue"],
        "2\n1.5 2 3 0 0 1\n4 5 6 0 -1 0\n": ["column_4", "column_5", "column_6"],
    }
    for text, expected in names.items():
        assert list(read_scan(save("a.pts", text)).fields) == expected
    assert list(read_scan(save("a.pts", _COLOURED), columns="x y z i _ _ _").fields) == ["i"]


def test_files_without_a_count_are_tables(save):
    scan = read_scan(save("a.pts", "1.5,2,3\n4,5,6\n"))
    assert scan.points.tolist() == [[1.5, 2, 3], [4, 5, 6]]
    assert scan.format == "pts"


def test_several_blocks_are_chosen_by_number(save):
    path = save("a.pts", _COLOURED + "\n1\n7 8 9\n")
    with pytest.raises(FormatError, match=r"found 2 stations: 1 \(2 points\), 2 \(1 points\)"):
        read_scan(path)
    assert [len(scan) for scan in read_scans(path)] == [2, 1]
    assert read_scan(f"{path}#2").points.tolist() == [[7, 8, 9]]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("3\n1 2 3\n4 5 6\n", "line 1: expected 3 points, found 2"),
        ("1\n1 2 3\n4 5 6\n", "line 3: expected the number of points of the next block"),
        ("2\n1 2 3\n\n", "line 2: expected 2 lines of numbers, found 1 blank ones"),
        ("2\n1 2 3\n4 5\n", "line 3: expected 3 numbers as on line 2"),
        ("2\n1 2 3\n4 5 six\n", "line 3: expected a number, found 'six'"),
        ("0\n", "at least one point"),
    ],
)
def test_malformed_blocks_are_refused(save, text, complaint):
    with pytest.raises(FormatError, match=complaint):
        read_scan(save("a.pts", text), format="pts")


def test_written_digits_read_back_exactly(tmp_path):
    rng = np.random.default_rng(2)
    points = rng.normal(size=(5, 3)) * [1e-9, 1e9, 1]
    points[1, 1], points[2, 2], points[3, 0] = np.nan, -np.inf, -0.0
    fields = {
        "ring": np.array([0, 1, 2, 3, 2**62 + 1]),
        "blue": np.arange(5, dtype=np.uint8),
        "red": np.arange(5, dtype=np.uint8),
        "green": np.arange(5, dtype=np.uint8),
        "intensity": rng.random(5),
    }
    path = tmp_path / "a.pts"
    write_scan(path, points, fields)
    assert path.read_text().splitlines()[0] == "5"
    again = read_scan(path, columns="x y z intensity red green blue ring")
    assert again.notes == ()
    assert np.array_equal(again.points, points, equal_nan=True)
    for name, values in fields.items():
        assert np.array_equal(again.fields[name], values)
    del fields["ring"]
    write_scan(path, points, fields)
    assert list(read_scan(path).fields) == ["intensity", "red", "green", "blue"]
    with pytest.raises(InvalidInput, match="text cannot hold field word"):
        write_scan(path, points, {"word": np.full(5, "a")})
