import numpy as np
import pytest

from scanlock.errors import FormatError, InvalidInput
from scanlock.io import read_scan, write_scan

_ROWS = [[1.0, -2.5, 3e-3], [4.0, 5.0, 6.0]]


@pytest.mark.parametrize("name", ["a.csv", "a.txt", "a.xyz", "a.asc", "a.3d"])
@pytest.mark.parametrize(
    "text",
    [
        "1 -2.5 3e-3\n4 5 6\n",
        "  1   -2.5\t3e-3  \n4 5 6",
        "1,-2.5,3e-3\n4,5,6\n",
        "1 , -2.5 , 3e-3\n4, 5 ,6\n",
        "1;-2.5;3e-3\r\n4;5;6\r\n",
        "1\t-2.5\t3E-3\r4\t5\t6\r",
        "1,-2.5,3e-3,\n4,5,6,\n",
        '"1","-2.5","3e-3"\n"4","5","6"\n',
        "\n# by hand\n1 -2.5 3e-3 # the first\n\n// and\n% so on\n4 5 6\n\n",
        "\ufeff1 -2.5 3e-3\n4 5 6\n",
        "x y z\n1 -2.5 3e-3\n4 5 6\n",
        "+1. -2.5 .3e-2\n4.0 +5e0 6\n",
    ],
)
def test_every_separator_is_read_for_every_extension(save, name, text):
    scan = read_scan(save(name, text))
    assert scan.points.tolist() == _ROWS
    assert (scan.format, scan.encoding, scan.coordinate_dtype) == ("txt", "ascii", "float64")


@pytest.mark.parametrize(
    "text",
    [
        "ring,X,Y,Z,time stamp\n7,1,2,3,0.5\n8,4,5,6,0.75\n",
        '"ring";"x";"y";"z";"time stamp"\n7;1;2;3;0.5\n8;4;5;6;0.75\n',
        "# made by hand\n#ring,x,y,z,time stamp\n7 1 2 3 0.5\n8 4 5 6 0.75\n",
        "ring,Points_m_XYZ:0,Points_m_XYZ:1,Points_m_XYZ:2,time stamp,\n"
        "7,1,2,3,.5,\n8,4,5,6,.75,\n",
    ],
)
def test_names_of_columns_are_used(save, text):
    scan = read_scan(save("a.csv", text))
    assert scan.points.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert list(scan.fields) == ["ring", "time stamp"]
    assert scan.fields["ring"].tolist() == [7, 8]
    assert scan.fields["ring"].dtype == np.int64
    assert scan.fields["time stamp"].tolist() == [0.5, 0.75]


def test_names_in_a_comment_are_used_only_if_they_fit(save):
    scan = read_scan(save("a.xyz", "// x y z of a car\n//X Y Z I\n1 2 3 4\n5 6 7 8\n"))
    assert list(scan.fields) == ["I"]
    plain = read_scan(save("b.xyz", "# scan of today's walk at 3\n1 2 3 4\n5 6 7 8\n"))
    assert list(plain.fields) == ["column_4"]


def test_given_columns_name_the_fields(save):
    path = save("a.txt", "9 1 2 3\n8 4 5 6\n")
    scan = read_scan(path, columns="label x y z")
    assert scan.points.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert scan.fields["label"].tolist() == [9, 8]
    assert len(read_scan(path, columns=4).fields) == 1
    with pytest.raises(FormatError, match="3 columns, as requested, found 4"):
        read_scan(path, columns=3)


def test_repeated_names_are_numbered(save):
    scan = read_scan(save("a.csv", "x,y,z,n,n,X\n1,2,3,4,5,6\n"))
    assert scan.points.tolist() == [[1, 2, 3]]
    assert list(scan.fields) == ["n", "n_2", "X"]


def test_decimal_commas_are_read_with_a_note(save):
    for text in ("1,0;-2,5;3e-3\n4;5;6\n", "1,0 -2,5 0,003\n4,0 5,0 6,0\n"):
        scan = read_scan(save("a.txt", text))
        assert scan.points.tolist() == _ROWS
        assert "decimal points" in scan.notes[0]


def test_missing_cells_are_nan_and_keep_their_row(save):
    scan = read_scan(save("a.csv", "x,y,z,i\n1,,3,4\n5,6,,8\n9,10,11,nan\n"))
    assert np.array_equal(
        scan.points, [[1, np.nan, 3], [5, 6, np.nan], [9, 10, 11]], equal_nan=True
    )
    assert np.isnan(scan.fields["i"][2])


def test_whole_numbers_keep_every_digit(save):
    stamps = [1647090478710633039, 1647090478710633040]
    big = [2**64 - 1, 2**63]
    text = "".join(f"1 2 3 {t} {b} {10**30}\n" for t, b in zip(stamps, big, strict=True))
    scan = read_scan(save("a.txt", text), columns="x y z t hash huge")
    assert scan.fields["t"].tolist() == stamps
    assert scan.fields["hash"].tolist() == big
    assert scan.fields["huge"].tolist() == [1e30, 1e30]


def test_numbers_beyond_float64_are_infinite(save):
    scan = read_scan(save("a.txt", "1 2 " + "9" * 5000 + "\n"))
    assert scan.points.tolist() == [[1, 2, np.inf]]
    with pytest.raises(FormatError, match="line 2"):
        read_scan(save("b.txt", "9" * 5000 + "\n1 2 3\n"))


def test_truncated_lines_and_3dtk_units_are_noted(save):
    assert "no line end" in read_scan(save("a.txt", "1 2 3\n4 5 6")).notes[0]
    assert "left-handed" in read_scan(save("a.3d", "1 2 3\n4 5 6\n")).notes[0]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("1 2 3\n4 5\n", "line 2: expected 3 numbers as on line 1, found 2"),
        ("# c\n\n1 2 3\n4 5 6\n7 8 9 10\n", "line 5: expected 3 numbers as on line 3, found 4"),
        ("x,y,z\n1,2,3\n4,five,6\n", "line 3: expected a number, found 'five'"),
        ("1 2 3\n4 5 6_0\n", "line 2: expected a number, found '6_0'"),
        ("1 2 3\n4 5\u00a06 7\n", "line 2: expected a number"),
        ("1 2 3\n\u0664 5 6\n", "line 2: expected a number"),
        ("1 2\n3 4\n", "at least three columns, found 2"),
        ("x,y,z,i\n1,2,3\n", "a number for each of x, y, z, i, found 3 columns"),
        ("lat,lon,height\n1,2,3\n", "columns named x, y and z, found lat, lon, height"),
        ("x y z\n", "at least one line of numbers"),
        ("# nothing\n", "at least one line of numbers"),
        ("\n \n", "at least one line of numbers"),
        ("a table\nof numbers\n1 2 3\n", "line 2: expected"),
        ("1 2 3\n4 5 \x006\n", "byte 10: expected plain text, found the byte 0x00"),
    ],
)
def test_errors_name_the_invalid_line(save, text, complaint):
    with pytest.raises(FormatError, match=complaint):
        read_scan(save("a.txt", text))


def test_utf_16_is_refused_by_name(save):
    with pytest.raises(FormatError, match="UTF-16"):
        read_scan(save("a.txt", "1 2 3\n".encode("utf-16")))


def test_trajectories_are_refused_as_scans(save):
    kitti = "1 0 0 5 0 1 0 6 0 0 1 7\n0 -1 0 5 1 0 0 6 0 0 1 7\n"
    tum = "0.5 1 2 3 0 0 0 1\n0.6 1 2 3 0 0.6 0 0.8\n"
    for text, count in ((kitti, 12), (tum, 8)):
        with pytest.raises(FormatError, match=f"2 poses of a trajectory \\({count} numbers"):
            read_scan(save("a.txt", text))
    assert len(read_scan(save("b.txt", tum), columns=8)) == 2


@pytest.mark.parametrize(
    ("name", "first"),
    [
        ("a.csv", "x,y,z,ring,n_0,n_1"),
        ("a.xyz", "# x y z ring n_0 n_1"),
    ],
)
@pytest.mark.parametrize("dtype", ["f4", "f8"])
def test_written_digits_read_back_exactly(tmp_path, name, first, dtype):
    rng = np.random.default_rng(2)
    points = (rng.normal(size=(5, 3)) * [1e-9, 1e9, 1]).astype(dtype)
    points[1, 1], points[2, 2], points[3, 0] = np.nan, -np.inf, -0.0
    fields = {"ring": np.array([0, 1, 2, 3, 2**62 + 1]), "n": rng.random((5, 2)).astype(dtype)}
    path = tmp_path / name
    write_scan(path, points, fields)
    assert path.read_text().splitlines()[0] == first
    again = read_scan(path)
    assert again.notes == ()
    assert np.array_equal(again.points.astype(dtype), points, equal_nan=True)
    assert np.signbit(again.points[3, 0])
    assert np.array_equal(again.fields["ring"], fields["ring"])
    assert np.array_equal(again.fields["n_1"].astype(dtype), fields["n"][:, 1])
    if dtype == "f4":
        assert len(path.read_bytes()) < 600


def test_scans_without_fields_have_no_line_of_names(tmp_path):
    write_scan(tmp_path / "a.xyz", np.array(_ROWS))
    assert (tmp_path / "a.xyz").read_text() == "1.0 -2.5 0.003\n4.0 5.0 6.0\n"


@pytest.mark.parametrize(
    ("fields", "complaint"),
    [
        ({"a,b": [1, 2]}, "cannot be named"),
        ({"a b": [1, 2]}, "one word"),
        ({"word": ["a", "b"]}, "cannot hold field word"),
    ],
)
def test_fields_that_would_not_read_back_are_not_written(tmp_path, fields, complaint):
    with pytest.raises(InvalidInput, match=complaint):
        write_scan(tmp_path / "a.csv", np.array(_ROWS), fields)
    assert not (tmp_path / "a.csv").exists()


def test_columns_with_names_are_chosen_and_renamed(save):
    path = save("a.csv", "id,Easting,Northing,Height (m),Refl\n7,1,2,3,.5\n8,4,5,6,.75\n")
    scan = read_scan(path, columns="x=easting,y=northing,z=Height (m),intensity=refl")
    assert scan.points.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert list(scan.fields) == ["intensity"]
    numbered = read_scan(path, columns="x=2 y=3 z=4 id")
    assert np.array_equal(numbered.points, scan.points)
    assert numbered.fields["id"].tolist() == [7, 8]
    with pytest.raises(FormatError, match="a column 'east', as requested, found 5 columns: id, E"):
        read_scan(path, columns="x=east y=northing z=4")
    with pytest.raises(FormatError, match="a column '6', as requested"):
        read_scan(path, columns="x=2 y=3 z=6")
    assert list(read_scan(path, columns="n x y z i").fields) == ["n", "i"]


def test_names_in_another_order_are_used(save):
    path = save("a.csv", "z,t,y,x\n1,2,3,4\n5,6,7,8\n")
    assert read_scan(path).points.tolist() == [[4, 3, 1], [8, 7, 5]]
    assert read_scan(path, columns="x y z t").points.tolist() == [[4, 3, 1], [8, 7, 5]]
    assert list(read_scan(path, columns="x y z").fields) == []


def test_columns_without_names_are_chosen_by_number(save):
    path = save("a.txt", "9 1 2 3\n8 4 5 6\n")
    assert read_scan(path, columns="x=2 y=3 z=4").points.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert list(read_scan(path, columns="_ x y z").fields) == []
    with pytest.raises(FormatError, match="a column 'label', as requested, found 4 columns;"):
        read_scan(path, columns="x=2 y=3 z=4 label")


def test_the_csv_files_of_ouster_are_read(save):
    head = "# frame num: 0\n# TIMESTAMP (ns), ROW, RANGE (mm), X1 (m), Y1 (m), Z1 (m)\n"
    scan = read_scan(save("a.csv", head + "\n5, 0, 1, 1.5, 2.5, 3.5\n6, 1, 1, 4.5, 5.5, 6.5\n"))
    assert scan.points.tolist() == [[1.5, 2.5, 3.5], [4.5, 5.5, 6.5]]


_FIRST_COLUMNS = {
    "unix": lambda n: 1.7e9 + np.arange(n) / n,
    "nanoseconds": lambda n: 10**18 + 1000 * np.arange(n),
    "seconds": lambda n: np.linspace(0.0, 0.1, n),
    "index": lambda n: np.arange(n) + 5,
    "intensity": lambda n: np.random.default_rng(2).integers(0, 256, n),
    "reflectance": lambda n: np.random.default_rng(2).random(n),
    "constant": lambda n: np.full(n, 3),
}


@pytest.mark.parametrize("name", ["a.txt", "a.csv", "a.npy"])
@pytest.mark.parametrize("first", _FIRST_COLUMNS)
def test_columns_before_x_are_refused_unless_named(tmp_path, room_scan, name, first):
    points = np.round(room_scan()[::7], 4)
    table = np.column_stack([_FIRST_COLUMNS[first](len(points)), points])
    path = tmp_path / name
    if name == "a.npy":
        np.save(path, table)
    else:
        np.savetxt(path, table, fmt="%.17g", delimiter="," if name == "a.csv" else " ")
    with pytest.raises(FormatError, match=r'pass columns="[ti] x y z" if that is the order, else'):
        read_scan(path)
    assert np.array_equal(read_scan(path, columns="t x y z").points, points)
    assert np.array_equal(read_scan(path, columns=4).points, table[:, :3])


@pytest.mark.parametrize("fourth", _FIRST_COLUMNS)
def test_columns_after_z_are_read(tmp_path, room_scan, fourth):
    points = np.round(room_scan()[::7], 4)
    np.savetxt(
        tmp_path / "a.txt", np.column_stack([points, _FIRST_COLUMNS[fourth](len(points))]), "%.17g"
    )
    assert np.array_equal(read_scan(tmp_path / "a.txt").points, points)


def test_a_height_grid_with_values_is_read(tmp_path):
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(600000.0, 600020), np.arange(30.0)))
    rows = np.column_stack([np.sort(x), y, 100 + np.sin(x + y), np.full(len(x), 0.5)])
    np.savetxt(tmp_path / "a.txt", rows)
    assert np.array_equal(read_scan(tmp_path / "a.txt").points, rows[:, :3])
