import struct

import numpy as np
import pytest

from reference.scan_formats import read_ply as read_slowly
from scanlock.errors import FormatError, InvalidInput
from scanlock.io import read_scan, write_scan

_N = 12
_RNG = np.random.default_rng(1)
_POINTS = _RNG.normal(size=(_N, 3)) * 30
_POINTS[4] = np.nan
_FIELDS = {
    "intensity": _RNG.random(_N).astype(np.float32),
    "time": _RNG.random(_N) * 1e9,
    "i1": _RNG.integers(-128, 128, _N, dtype=np.int8),
    "u1": _RNG.integers(0, 2**8, _N, dtype=np.uint8),
    "i2": _RNG.integers(-(2**15), 2**15, _N, dtype=np.int16),
    "u2": _RNG.integers(0, 2**16, _N, dtype=np.uint16),
    "i4": _RNG.integers(-(2**31), 2**31, _N, dtype=np.int32),
    "u4": _RNG.integers(0, 2**32, _N, dtype=np.uint32),
}
_ASCII = """ply
format ascii 1.0
comment made by hand
element face 2
property list uchar int vertex_indices
element vertex 2
property float x
property double y
property float z
property uchar red
obj_info and an edge
element edge 1
property int a
property int b
end_header
3 0 1 1
4 0 1 1 0
1 2.5 3 255
4 5 6 7
0 1
"""
_POINTS_OF_ASCII = [[1, 2.5, 3], [4, 5, 6]]


def _binary(order, faces=((0, 1, 1), (0, 1, 1, 0))):
    name = {"<": "little", ">": "big"}[order]
    head = _ASCII[: _ASCII.index("end_header\n") + len("end_header\n")]
    head = head.replace("ascii", f"binary_{name}_endian").replace("face 2", f"face {len(faces)}")
    body = b"".join(struct.pack(f"{order}B{len(face)}i", len(face), *face) for face in faces)
    body += struct.pack(f"{order}fdfB", 1, 2.5, 3, 255) + struct.pack(f"{order}fdfB", 4, 5, 6, 7)
    return head.encode() + body + struct.pack(f"{order}2i", 0, 1)


@pytest.mark.parametrize("encoding", ["binary", "ascii"])
@pytest.mark.parametrize("dtype", ["f4", "f8"])
def test_round_trip_of_every_type(tmp_path, encoding, dtype):
    path = tmp_path / "a.ply"
    points = _POINTS.astype(dtype)
    write_scan(path, points, _FIELDS, encoding=encoding)
    scan = read_scan(path)
    assert np.array_equal(scan.points, points, equal_nan=True)
    assert scan.coordinate_dtype == points.dtype.name
    assert list(scan.fields) == list(_FIELDS)
    for name, values in _FIELDS.items():
        assert scan.fields[name].dtype == values.dtype
        assert np.array_equal(scan.fields[name], values)


@pytest.mark.parametrize("encoding", ["binary", "ascii"])
def test_the_reader_agrees_with_the_reference(tmp_path, encoding):
    path = tmp_path / "a.ply"
    write_scan(path, _POINTS, _FIELDS, encoding=encoding)
    scan, slow = read_scan(path), read_slowly(path)
    assert np.array_equal(scan.points, np.stack([slow[axis] for axis in "xyz"], 1), equal_nan=True)
    for name in scan.fields:
        assert np.array_equal(scan.fields[name], slow[name])


@pytest.mark.parametrize(
    "content",
    [
        _ASCII.encode(),
        _ASCII.replace("\n", "\r\n").encode(),
        _ASCII.replace("\n", "\r").encode(),
        _binary("<"),
        _binary(">"),
        _binary("<", faces=[(0, 1, 1)] * 5),
        _binary(">", faces=[()]),
        _binary("<", faces=[]),
        _binary("<").replace(b"\n", b"\r\n", _ASCII[: _ASCII.index("3 0 1 1")].count("\n")),
    ],
    ids=[
        "ascii",
        "crlf",
        "cr",
        "little",
        "big",
        "triangles",
        "empty list",
        "no faces",
        "crlf binary",
    ],
)
def test_elements_other_than_vertices_are_skipped(save, content):
    scan = read_scan(save("a.ply", content))
    assert scan.points.tolist() == _POINTS_OF_ASCII
    assert scan.fields["red"].tolist() == [255, 7]
    assert scan.fields["red"].dtype == np.uint8


def test_fields_of_several_values_become_several_properties(tmp_path):
    write_scan(tmp_path / "a.ply", _POINTS, {"n": np.arange(3 * _N).reshape(_N, 3) % 200})
    assert list(read_scan(tmp_path / "a.ply").fields) == ["n_0", "n_1", "n_2"]
    with pytest.raises(InvalidInput, match="named n_0"):
        write_scan(tmp_path / "b.ply", _POINTS, {"n": np.ones((_N, 1)), "n_0": np.ones(_N)})


def test_integers_beyond_2_to_the_53_are_not_written(tmp_path):
    path = tmp_path / "a.ply"
    write_scan(path, _POINTS, {"t": np.full(_N, 2**53), "ok": np.arange(_N) > 4})
    assert read_scan(path).fields["t"].tolist() == [2.0**53] * _N
    assert read_scan(path).fields["ok"].dtype == np.uint8
    for value in (2**53 + 1, -(2**63)):
        with pytest.raises(InvalidInput, match="larger ones in field t"):
            write_scan(path, _POINTS, {"t": np.full(_N, value)})


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("ply\n", "plx\n", "expected PLY"),
        ("format ascii 1.0\n", "", "line 3"),
        ("format ascii 1.0", "format ascii 2.0", "line 2"),
        ("format ascii 1.0", "format middle_endian 1.0", "line 2"),
        ("property float x", "property float q", "x, y and z, found q, y, z, red"),
        ("property float x", "property half x", "line 7: expected a type among"),
        ("property list uchar int", "property list float int", "line 5: expected a whole-number"),
        ("property float x", "property list uchar int x", "scalar properties only"),
        ("element vertex 2", "element vertex two", "line 6"),
        ("element vertex 2", "element vertex 0", "found 2 face, 0 vertex, 1 edge"),
        ("element vertex 2", "element point 2", "one element vertex"),
        ("element face 2", "element vertex 2", "one element vertex"),
        ("end_header", "end", "line 15"),
        ("4 5 6 7\n", "", "expected 5 lines of data, found 4"),
        ("0 1\n", "0 1\n0 1\n", "expected 5 lines of data, found 6"),
        ("4 5 6 7", "4 5 6", "line 19: expected 4 numbers, found 3"),
        ("4 5 6 7", "4 5 6 red", "line 19: expected a number, found 'red'"),
        ("4 5 6 7", "4 5 6 700", "red of type uint8"),
    ],
)
def test_errors_name_the_invalid_line(save, old, new, complaint):
    assert old in _ASCII
    with pytest.raises(FormatError, match=complaint):
        read_scan(save("a.ply", _ASCII.replace(old, new, 1)))


def test_lists_beyond_the_end_are_refused(save):
    data = _binary("<")
    at = data.index(b"end_header\n") + len(b"end_header\n")
    with pytest.raises(FormatError, match="element face"):
        read_scan(save("a.ply", data[:at] + b"\xff" + data[at + 1 :]))
    signed = data.replace(b"list uchar", b"list char ")
    at = signed.index(b"end_header\n") + len(b"end_header\n")
    with pytest.raises(FormatError, match="element face"):
        read_scan(save("b.ply", signed[:at] + b"\xff" + signed[at + 1 :]))


@pytest.mark.parametrize("row", ["-3 0 1 1", "3 0 1", "3", "3 0 1 1 1", "two 0 1"])
def test_lists_of_a_wrong_length_are_refused_in_text(save, row):
    assert "\n3 0 1 1\n" in _ASCII
    damaged = _ASCII.replace("\n3 0 1 1\n", f"\n{row}\n")
    with pytest.raises(FormatError, match="line 16: expected a row of element face with lists"):
        read_scan(save("a.ply", damaged))


def test_columns_are_chosen_by_name(save):
    scan = read_scan(save("a.ply", _ASCII), columns="x y z")
    assert list(scan.fields) == []
    swapped = read_scan(save("a.ply", _ASCII), columns=["x=y", "y=x", "z", "colour=red"])
    assert np.array_equal(swapped.points, read_scan(save("a.ply", _ASCII)).points[:, [1, 0, 2]])
    assert list(swapped.fields) == ["colour"]
    with pytest.raises(InvalidInput, match="must be names of PLY, which names its own"):
        read_scan(save("a.ply", _ASCII), columns=3)
