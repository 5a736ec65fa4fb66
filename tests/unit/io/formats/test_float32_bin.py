import numpy as np
import pytest

from scanlock.errors import FormatError, InvalidInput
from scanlock.io import read_scan, write_scan


def _rows(room_scan, width, rows=1200):
    rng = np.random.default_rng(width)
    points = room_scan()[:: max(1, 5760 // rows)][:rows]
    more = [rng.random(len(points)), rng.integers(0, 16, len(points))]
    return np.column_stack([points, *more])[:, :width].astype("<f4")


@pytest.mark.parametrize("width", [3, 4, 5])
@pytest.mark.parametrize("order", ["file", "shuffled"])
def test_the_row_length_of_ambiguous_sizes_is_guessed(room_scan, save, width, order):
    rows = _rows(room_scan, width)
    if order == "shuffled":
        rows = np.random.default_rng(1).permutation(rows)
    assert all(rows.size % other == 0 for other in (3, 4, 5))
    scan = read_scan(save("a.bin", rows.tobytes()))
    assert np.array_equal(scan.points, rows[:, :3].astype(np.float64))
    assert list(scan.fields) == ["intensity", "ring"][: width - 3]
    assert scan.coordinate_dtype == "float32"
    assert any(f"{width} float32 columns guessed" in note for note in scan.notes)


def test_the_only_row_length_that_fits_the_size_is_assumed(save):
    scan = read_scan(save("a.bin", np.arange(1, 22, dtype="<f4").tobytes()))
    assert scan.points.shape == (7, 3)
    assert "only common number" in scan.notes[0]


def test_given_columns_override_the_guess(room_scan, save):
    rows = _rows(room_scan, 4)
    path = save("a.bin", rows.tobytes())
    named = read_scan(path, columns="x y z label")
    assert np.array_equal(named.fields["label"], rows[:, 3])
    assert named.notes == ()
    assert len(read_scan(path, columns=3)) == 1600
    swapped = read_scan(path, columns=["label", "z", "y", "x"])
    assert np.array_equal(swapped.points, rows[:, [3, 2, 1]])


def test_an_undecided_row_length_is_assumed_with_a_note(save):
    same = np.random.default_rng(3).random((240, 1)).repeat(4, axis=1).ravel().astype("<f4")
    scan = read_scan(save("a.bin", same.tobytes()))
    assert scan.points.shape == (240, 3)
    assert "assumed: the size also fits" in scan.notes[0]
    negative = read_scan(save("b.bin", (same - 0.5).tobytes()))
    assert negative.points.shape == (320, 3)


@pytest.mark.parametrize("width", [3, 4])
def test_truncated_files_are_detected_by_their_values(room_scan, save, width):
    data = _rows(room_scan, width).tobytes()
    for left in range(1, 4 * width):
        path = save("a.bin", data[: len(data) - 4 * width + left])
        with pytest.raises(FormatError, match="cut short"):
            read_scan(path)


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (np.random.default_rng(1).normal(size=300) * 40, "doubles, integers or another"),
        (np.arange(300, dtype="<u4") % 250 + 1, "doubles, integers or another"),
        (np.zeros(300, "<f4"), "0 of 0 sampled values"),
        (np.linspace(0, 0.1, 3000).astype("<f4"), "only ascend"),
        (np.full(7, 2.5, "<f4"), "3, 4 or 5"),
        (np.full(1, 2.5, "<f4"), "3, 4 or 5"),
    ],
)
def test_implausible_coordinates_are_refused(save, content, complaint):
    with pytest.raises(FormatError, match=complaint):
        read_scan(save("a.bin", content.tobytes()))


def test_given_columns_skip_the_plausibility_check(save):
    path = save("a.bin", np.linspace(0, 0.1, 3000).astype("<f4").tobytes())
    assert len(read_scan(path, columns=3)) == 1000
    with pytest.raises(FormatError, match="whole rows of 7"):
        read_scan(path, columns=7)


@pytest.mark.parametrize(
    ("columns", "complaint"),
    [(2, "at least 3"), ("x y label", "name x, y and z"), ("x y z z", "unique names")],
)
def test_invalid_columns_are_refused(save, columns, complaint):
    with pytest.raises(InvalidInput, match=complaint):
        read_scan(save("a.bin", bytes(48)), columns=columns)


def test_rows_are_written_as_in_kitti(tmp_path, room_scan):
    rows = _rows(room_scan, 4)
    path = tmp_path / "a.bin"
    write_scan(path, rows[:, :3], {"intensity": rows[:, 3]})
    assert path.read_bytes() == rows.tobytes()
    write_scan(path, rows[:, :3])
    assert path.read_bytes() == rows[:, :3].tobytes()


def test_rows_with_nan_are_kept(tmp_path, room_scan):
    points = _rows(room_scan, 3)
    points[5] = np.nan
    write_scan(tmp_path / "a.bin", points)
    again = read_scan(tmp_path / "a.bin")
    assert np.array_equal(again.points, points, equal_nan=True)


def test_the_writer_refuses_other_fields_and_large_coordinates(tmp_path):
    path = tmp_path / "a.bin"
    with pytest.raises(InvalidInput, match="intensity only, got ring"):
        write_scan(path, np.ones((3, 3)), {"ring": np.arange(3)})
    with pytest.raises(InvalidInput, match="round coordinates by up to 0"):
        write_scan(path, np.full((3, 3), 5_403_210.2))
    with pytest.raises(InvalidInput, match="round coordinates by up to inf"):
        write_scan(path, np.full((3, 3), 1e40))
    assert not path.exists()


def _with_columns(room_scan, *columns):
    points = room_scan()[::4]
    rng = np.random.default_rng(5)
    more = {
        "intensity": lambda: rng.random(len(points)),
        "ring": lambda: rng.integers(0, 16, len(points)),
        "time": lambda: np.linspace(0.0, 0.1, len(points)),
        "colour": lambda: rng.integers(0, 256, len(points)),
        "light": lambda: rng.random(len(points)),
    }
    parts = [points[:, "xyz".index(name)] if name in "xyz" else more[name]() for name in columns]
    return np.stack(parts, axis=1).astype("<f4")


@pytest.mark.parametrize(
    ("colour", "rows"), [("colour", 1440), ("colour", 1439), ("colour", 60), ("light", 1440)]
)
def test_rows_with_three_colours_are_recognised(room_scan, save, colour, rows):
    table = _with_columns(room_scan, "x", "y", "z", colour, colour, colour)[:rows]
    scan = read_scan(save("a.bin", table.tobytes()))
    assert np.array_equal(scan.points, table[:, :3].astype(np.float64))
    assert list(scan.fields) == ["red", "green", "blue"]
    assert "6 float32 columns guessed from the values" in scan.notes[0]


def test_rows_of_nuscenes_have_a_ring_and_rows_with_times_have_none(room_scan, save):
    table = _with_columns(room_scan, "x", "y", "z", "colour", "ring")
    assert list(read_scan(save("a.bin", table[:12].tobytes())).fields) == ["intensity", "ring"]
    timed = _with_columns(room_scan, "x", "y", "z", "intensity", "time")
    assert list(read_scan(save("a.bin", timed.tobytes())).fields) == ["intensity", "column_5"]


@pytest.mark.parametrize(
    "more",
    [
        ["intensity", "ring", "time"],
        ["intensity", "colour", "colour", "colour"],
        ["intensity", "ring", "time", "light", "colour"],
    ],
)
@pytest.mark.parametrize("rows", [1440, 1439, 1438])
def test_rows_of_unknown_columns_are_refused(room_scan, save, more, rows):
    table = _with_columns(room_scan, "x", "y", "z", *more)[:rows]
    path = save("a.bin", table.tobytes())
    with pytest.raises(FormatError, match=f"found rows of {len(more) + 3} float32"):
        read_scan(path)
    assert len(read_scan(path, columns=len(more) + 3)) == rows


@pytest.mark.parametrize("first", ["intensity", "ring", "time"])
def test_rows_that_do_not_begin_with_x_are_refused(room_scan, save, first):
    table = _with_columns(room_scan, first, "x", "y", "z")
    path = save("a.bin", table.tobytes())
    with pytest.raises(FormatError, match="expected x, y, z in the first three columns"):
        read_scan(path)
    scan = read_scan(path, columns="_ x y z")
    assert np.array_equal(scan.points, table[:, 1:].astype(np.float64))
    assert list(scan.fields) == []
    with pytest.raises(InvalidInput, match="name every column of a row in order"):
        read_scan(path, columns="x=2 y=3 z=4")
