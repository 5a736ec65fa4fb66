import numpy as np
import pytest

from scanlock.errors import FormatError, InvalidInput
from scanlock.io import read_scan, write_scan

_ASCII = """# vtk DataFile Version 3.0
made by hand
ASCII
DATASET POLYDATA
FIELD FieldData 1
time 1 1 double
17.5
POINTS 3 float
1 2 3 4 5
6 -7 8 nan
VERTICES 1 4
3 0 1 2
POLYGONS 1 4
3 0 1 2
POINT_DATA 3
SCALARS ring unsigned_char 1
LOOKUP_TABLE default
1 2 255
COLOR_SCALARS rgb 3
0 0.2 1 0 0 0 1 1 1
NORMALS normals float
0 0 1 0 0 1 0 1 0
FIELD FieldData 2
a%20b 2 3 double
1 2 3 4 5 6
METADATA
INFORMATION 0

t 1 3 vtktypeint64
1647090478710633039 0 -1
CELL_DATA 2
SCALARS part int
1 2
"""
_NEW_CELLS = """VERTICES 2 3
OFFSETS vtktypeint64
0 3
CONNECTIVITY vtktypeint64
0 1 2
"""


def _binary(text):
    """Return the binary form of a file of which all numbers are of one line per section."""
    kinds = {"float": ">f4", "double": ">f8", "int": ">i4", "unsigned_char": ">u1"}
    kinds["vtktypeint64"] = ">i8"
    out, dtype = [], None
    for line in text.replace("ASCII", "BINARY").splitlines():
        words = line.split()
        if words and (words[0] == "nan" or words[0].lstrip("-")[0].isdigit()):
            scale = 255 if dtype == "colour" else 1
            values = np.array([float(word) for word in words]) * scale
            exact = [int(word) for word in words] if dtype == ">i8" else np.round(values, 3)
            kind = ">u1" if dtype == "colour" else dtype
            out.append(np.array(exact).astype(kind).tobytes())
            if dtype != ">f4" or "nan" in line or len(words) != 5:
                out.append(b"\n")
            continue
        out.append(line.encode() + b"\n")
        dtype = next((kinds[word] for word in reversed(words) if word in kinds), dtype)
        if words[:1] in (["VERTICES"], ["POLYGONS"]):
            dtype = ">i4"
        if words[:1] == ["COLOR_SCALARS"]:
            dtype = "colour"
    return b"".join(out)


@pytest.mark.parametrize("cells", ["old", "new"])
@pytest.mark.parametrize("encoding", ["ascii", "binary"])
def test_points_and_their_data_are_read(save, cells, encoding):
    text = _ASCII
    if cells == "new":
        text = text.replace("VERTICES 1 4\n3 0 1 2\n", _NEW_CELLS)
    scan = read_scan(save("a.vtk", text if encoding == "ascii" else _binary(text)))
    assert np.array_equal(scan.points, [[1, 2, 3], [4, 5, 6], [-7, 8, np.nan]], equal_nan=True)
    assert scan.coordinate_dtype == "float32"
    assert scan.encoding == encoding
    assert scan.fields["ring"].tolist() == [1, 2, 255]
    assert scan.fields["green"].tolist() == [51, 0, 255]
    assert scan.fields["ny"].tolist() == [0, 0, 1]
    assert scan.fields["a b"].tolist() == [[1, 2], [3, 4], [5, 6]]
    assert scan.fields["t"].tolist() == [1647090478710633039, 0, -1]
    assert "time" not in scan.fields
    assert "part" not in scan.fields


@pytest.mark.parametrize("dataset", ["UNSTRUCTURED_GRID", "STRUCTURED_GRID"])
def test_points_of_other_grids_are_read(save, dataset):
    text = f"# vtk DataFile Version 2.0\n\nASCII\nDATASET {dataset}\n"
    text += "DIMENSIONS 2 1 1\n" if dataset == "STRUCTURED_GRID" else ""
    text += "POINTS 2 double\n1 2 3\n4 5 6\n"
    text += "CELLS 2 4\n1 0\n1 1\nCELL_TYPES 2\n1 1\n" if dataset == "UNSTRUCTURED_GRID" else ""
    assert read_scan(save("a.vtk", text)).points.tolist() == [[1, 2, 3], [4, 5, 6]]


@pytest.mark.parametrize("encoding", ["ascii", "binary"])
@pytest.mark.parametrize("dtype", ["f4", "f8"])
def test_round_trip_of_every_type(tmp_path, encoding, dtype):
    rng = np.random.default_rng(0)
    points = (rng.normal(size=(7, 3)) * 30).astype(dtype)
    points[2, 1] = np.nan
    fields = {"normal": rng.random((7, 3)), "f4": rng.random(7, np.float32), "100%": np.arange(7)}
    for code in ("u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8"):
        limits = np.iinfo(code)
        fields[code] = rng.integers(limits.min, limits.max, 7, dtype=code, endpoint=True)
    path = tmp_path / "a.vtk"
    write_scan(path, points, fields, encoding=encoding)
    scan = read_scan(path)
    assert np.array_equal(scan.points.astype(dtype), points, equal_nan=True)
    assert scan.coordinate_dtype == np.dtype(dtype).name
    assert list(scan.fields) == list(fields)
    for name, values in fields.items():
        assert scan.fields[name].dtype == values.dtype
        assert np.array_equal(scan.fields[name], values)
    with pytest.raises(InvalidInput, match="VTK cannot hold field word"):
        write_scan(path, points, {"word": np.full(7, "a")})


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("# vtk DataFile", "# a DataFile", "first line"),
        ("ASCII", "TEXT", "ASCII or BINARY"),
        ("DATASET POLYDATA", "DATASET STRUCTURED_POINTS", "DATASET with points: POLYDATA"),
        ("POINTS 3 float", "POINTS 4 float", "expected 12 numbers of type float32"),
        ("POINTS 3 float", "POINTS -3 float", "a section of a dataset|a whole number"),
        ("POINTS 3 float", "POINTS 3 quaternion", "a type among unsigned_char"),
        ("6 -7 8 nan", "6 -7 8 n_n", "expected 9 numbers, found 9 words"),
        ("1 2 255", "1 2 256", "numbers that fit uint8"),
        ("1 2 255", "1 2 2.5", "3 numbers of type uint8"),
        ("1 2 255", "1 2", "expected 3 numbers"),
        ("0 0.2 1 0", "0 0.2 2 0", "colours from 0 to 1"),
        ("t 1 3 vtk", "t 1 2 vtk", "expected a section of a dataset of points, found '-1'"),
        (
            "t 1 3 vtktypeint64\n1647090478710633039 0 -1",
            "t 1 1 int\n5",
            "expected 3 values of point data t, found 1",
        ),
        ("SCALARS ring", "SHADES ring", "a section of a dataset of points"),
    ],
)
def test_malformed_sections_are_refused(save, old, new, complaint):
    assert old in _ASCII
    with pytest.raises(FormatError, match=complaint):
        read_scan(save("a.vtk", _ASCII.replace(old, new, 1)), format="vtk")


@pytest.mark.parametrize("encoding", ["ascii", "binary"])
def test_truncated_files_never_lose_points(tmp_path, encoding):
    path = tmp_path / "a.vtk"
    write_scan(path, np.arange(36.0).reshape(12, 3), {"ring": np.arange(12)}, encoding=encoding)
    data = path.read_bytes()
    for end in range(1, len(data)):
        path.write_bytes(data[:end])
        try:
            scan = read_scan(path)
        except FormatError:
            continue
        assert len(scan) == 12
