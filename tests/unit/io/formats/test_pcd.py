import struct

import numpy as np
import pytest

from reference.lzf import unpack
from reference.scan_formats import read_pcd as read_slowly
from scanlock.errors import FormatError, InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.io import read_scan, write_scan

_N = 12
_RNG = np.random.default_rng(0)
_POINTS = _RNG.normal(size=(_N, 3)) * 30
_POINTS[4] = np.nan
_POINTS[5, 0] = np.inf
_FIELDS = {
    "intensity": _RNG.random(_N).astype(np.float32),
    "time": _RNG.random(_N) * 1e9,
    "i1": _RNG.integers(-128, 128, _N, dtype=np.int8),
    "i2": _RNG.integers(-(2**15), 2**15, _N, dtype=np.int16),
    "i4": _RNG.integers(-(2**31), 2**31, _N, dtype=np.int32),
    "i8": _RNG.integers(-(2**63), 2**63 - 1, _N, dtype=np.int64),
    "u1": _RNG.integers(0, 2**8, _N, dtype=np.uint8),
    "u2": _RNG.integers(0, 2**16, _N, dtype=np.uint16),
    "u4": _RNG.integers(0, 2**32, _N, dtype=np.uint32),
    "u8": _RNG.integers(0, 2**64, _N, dtype=np.uint64),
    "histogram": _RNG.random((_N, 5)).astype(np.float32),
}
_VIEWPOINT = Pose.from_step(np.array([1.0, 2.0, 3.0, 0.1, -0.2, 0.3]))

_HEADER = """# .PCD v0.7 - Point Cloud Data file format
VERSION 0.7
FIELDS x y z
SIZE 4 4 4
TYPE F F F
COUNT 1 1 1
WIDTH 2
HEIGHT 1
VIEWPOINT 0 0 0 1 0 0 0
POINTS 2
DATA ascii
"""
_ASCII = _HEADER + "1 2 3\n4 5 6\n"


@pytest.mark.parametrize("encoding", ["binary", "ascii", "compressed"])
@pytest.mark.parametrize("dtype", ["f4", "f8"])
def test_round_trip_of_every_type(tmp_path, encoding, dtype):
    path = tmp_path / "a.pcd"
    points = _POINTS.astype(dtype)
    write_scan(path, points, _FIELDS, encoding=encoding, height=3, viewpoint=_VIEWPOINT)
    scan = read_scan(path)
    assert np.array_equal(scan.points, points, equal_nan=True)
    assert scan.coordinate_dtype == points.dtype.name
    assert scan.encoding == {"compressed": "binary_compressed"}.get(encoding, encoding)
    assert (scan.width, scan.height) == (4, 3)
    assert scan.viewpoint.is_close(_VIEWPOINT, translation=1e-15, rotation=1e-12)
    assert list(scan.fields) == list(_FIELDS)
    for name, values in _FIELDS.items():
        assert scan.fields[name].dtype == values.dtype
        assert np.array_equal(scan.fields[name], values)
    assert scan.notes == ()


@pytest.mark.parametrize("encoding", ["binary", "ascii", "compressed"])
def test_the_reader_agrees_with_the_reference(tmp_path, encoding):
    path = tmp_path / "a.pcd"
    write_scan(path, _POINTS, _FIELDS, encoding=encoding)
    scan, slow = read_scan(path), read_slowly(path)
    assert np.array_equal(scan.points, np.stack([slow[axis] for axis in "xyz"], 1), equal_nan=True)
    for name in scan.fields:
        assert np.array_equal(scan.fields[name], slow[name])


def test_compressed_files_are_stored_field_by_field(tmp_path):
    path = tmp_path / "a.pcd"
    write_scan(path, _POINTS, {"ring": _FIELDS["u1"]}, encoding="compressed")
    data = path.read_bytes()
    body = data[data.index(b"binary_compressed\n") + len(b"binary_compressed\n") :]
    packed, size = struct.unpack_from("<II", body)
    assert packed == len(body) - 8
    columns = [_POINTS[:, 0], _POINTS[:, 1], _POINTS[:, 2], _FIELDS["u1"]]
    assert unpack(body[8:]) == b"".join(column.tobytes() for column in columns)
    assert size == _N * 25


def test_compression_kernels_have_one_signature(tmp_path):
    from scanlock.kernels.io.lzf import lzf_decode, lzf_encode

    for dtype in ("f4", "f8"):
        write_scan(tmp_path / "a.pcd", _POINTS.astype(dtype), encoding="compressed")
        read_scan(tmp_path / "a.pcd")
    for kernel in (lzf_decode, lzf_encode):
        assert len(getattr(kernel, "signatures", [])) <= 1


@pytest.mark.parametrize("encoding", ["binary", "ascii", "compressed"])
def test_padding_is_skipped(save, encoding):
    header = _HEADER.replace("FIELDS x y z", "FIELDS x _ y z _ ring")
    header = header.replace("SIZE 4 4 4", "SIZE 4 1 4 4 2 2").replace(
        "TYPE F F F", "TYPE F U F F U U"
    )
    header = header.replace("COUNT 1 1 1", "COUNT 1 4 1 1 3 1")
    if encoding == "ascii":
        body = b"1 9 9 9 9 2 3 9 9 9 7\n4 9 9 9 9 5 6 9 9 9 8\n"
    else:
        rows = [struct.pack("<f4sff6sH", 1, b"\1" * 4, 2, 3, b"\2" * 6, 7)]
        rows += [struct.pack("<f4sff6sH", 4, b"\1" * 4, 5, 6, b"\2" * 6, 8)]
        body = b"".join(rows)
        if encoding == "compressed":
            parts = [struct.pack("<2f", 1, 4), b"\1" * 8, struct.pack("<2f", 2, 5)]
            parts += [struct.pack("<2f", 3, 6), b"\2" * 12, struct.pack("<2H", 7, 8)]
            raw = b"".join(parts)
            runs = [raw[k : k + 32] for k in range(0, len(raw), 32)]
            packed = b"".join(bytes([len(run) - 1]) + run for run in runs)
            body = struct.pack("<II", len(packed), len(raw)) + packed
    word = {"compressed": "binary_compressed"}.get(encoding, encoding)
    scan = read_scan(save("a.pcd", header.replace("DATA ascii", f"DATA {word}").encode() + body))
    assert scan.points.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert list(scan.fields) == ["ring"]
    assert scan.fields["ring"].tolist() == [7, 8]


def test_padding_after_the_data_is_accepted_and_points_are_not(save):
    binary = _HEADER.replace("ascii", "binary").encode() + struct.pack("<6f", *range(6))
    assert len(read_scan(save("a.pcd", binary + bytes(4096 - len(binary))))) == 2
    with pytest.raises(FormatError, match="expected 24 bytes of data from byte"):
        read_scan(save("a.pcd", binary + struct.pack("<3f", 6, 7, 8)))


def test_old_headers_without_count_viewpoint_and_height_are_read(save):
    lines = [line for line in _ASCII.splitlines(True) if line.split()[0] not in ("COUNT", "HEIGHT")]
    lines = [line for line in lines if not line.startswith(("VIEWPOINT", "WIDTH", "#"))]
    scan = read_scan(save("a.pcd", "".join(lines).replace("FIELDS", "COLUMNS")))
    assert scan.points.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert scan.viewpoint is None


def test_crlf_comments_and_blank_lines_are_read(save):
    text = _ASCII.replace("POINTS 2\n", "POINTS 2\n# a comment\n\n") + "\n"
    scan = read_scan(save("a.pcd", text.replace("\n", "\r\n")))
    assert scan.points.tolist() == [[1, 2, 3], [4, 5, 6]]


def test_viewpoint_is_the_pose_of_the_sensor(save):
    rotated = _ASCII.replace("VIEWPOINT 0 0 0 1 0 0 0", "VIEWPOINT 1 2 3 0.70710678 0 0 0.70710678")
    pose = read_scan(save("a.pcd", rotated)).viewpoint
    assert pose.translation.tolist() == [1, 2, 3]
    assert np.allclose(pose.apply(np.array([1.0, 0.0, 0.0])), [1, 3, 3])


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("FIELDS x y z", "FIELDS x y", "line 4 \\(SIZE\\): expected 2 entries"),
        ("FIELDS x y z", "FIELDS x y q", "x, y and z, found x, y, q"),
        ("FIELDS x y z\n", "", "expected a FIELDS line"),
        ("SIZE 4 4 4", "SIZE 4 4 3", "F of 4 or 8 bytes"),
        ("SIZE 4 4 4", "SIZE 4 4 x", "line 4 \\(SIZE\\): expected 3 whole numbers"),
        ("TYPE F F F", "TYPE F F G", "line 5 \\(TYPE\\)"),
        ("COUNT 1 1 1", "COUNT 1 1 0", "line 6 \\(COUNT\\)"),
        ("COUNT 1 1 1", "COUNT 1 1 2", "line 12: expected 4 numbers, found 3"),
        ("WIDTH 2", "WIDTH 3", "line 10 \\(POINTS\\): expected WIDTH x HEIGHT = 3, found '2'"),
        ("WIDTH 2", "WIDTH -2", "line 7 \\(WIDTH\\)"),
        ("WIDTH 2", "WIDTH " + "9" * 5000, "line 7 \\(WIDTH\\)"),
        ("WIDTH 2", "WIDTH 0", "WIDTH x HEIGHT = 0"),
        ("WIDTH 2\nHEIGHT 1", "WIDTH 0\nHEIGHT 2", "WIDTH x HEIGHT = 0"),
        ("VIEWPOINT 0 0 0 1 0 0 0", "VIEWPOINT 0 0 0 0 0 0 2", "unit quaternion"),
        ("VIEWPOINT 0 0 0 1 0 0 0", "VIEWPOINT 0 0 nan 1 0 0 0", "unit quaternion"),
        ("VIEWPOINT 0 0 0 1 0 0 0", "VIEWPOINT 0 0 0 1", "line 9 \\(VIEWPOINT\\)"),
        ("DATA ascii", "DATA zipped", "ascii, binary, binary_compressed"),
        ("POINTS 2", "POINTS 2\nPOINTS 2", "line 11"),
        ("POINTS 2", "SPEED 2", "line 10: expected one of"),
        ("4 5 6\n", "", "expected 2 rows, as given by POINTS, found 1"),
        ("4 5 6\n", "4 5 6\n7 8 9\n", "expected 2 rows, as given by POINTS, found 3"),
        ("4 5 6", "4 5", "line 13: expected 3 numbers, found 2"),
        ("4 5 6", "4 five 6", "line 13: expected a number, found 'five'"),
    ],
)
def test_errors_name_the_invalid_line(save, old, new, complaint):
    assert old in _ASCII
    with pytest.raises(FormatError, match=complaint):
        read_scan(save("a.pcd", _ASCII.replace(old, new)))


@pytest.mark.parametrize(
    ("kind", "value"), [("U 1", "256"), ("U 1", "-1"), ("I 2", "1.5"), ("F 4", "1e39")]
)
def test_ascii_values_beyond_the_declared_type_are_refused(save, kind, value):
    letter, size = kind.split()
    text = _ASCII.replace("x y z", "x y z ring").replace("4 4 4", f"4 4 4 {size}")
    text = text.replace("F F F", f"F F F {letter}").replace("1 1 1", "1 1 1 1")
    text = text.replace("1 2 3", "1 2 3 1").replace("4 5 6", f"4 5 6 {value}")
    with pytest.raises(FormatError, match="row 2 of the data"):
        read_scan(save("a.pcd", text))


def test_damaged_compression_is_refused(tmp_path):
    path = tmp_path / "a.pcd"
    write_scan(path, np.zeros((500, 3)), encoding="compressed")
    data = bytearray(path.read_bytes())
    start = data.index(b"binary_compressed\n") + len(b"binary_compressed\n")
    for offset, value, complaint in (
        (start + 4, 1, "expected 12000 unpacked bytes"),
        (start, 200, "bytes of data from byte"),
        (start + 8, 0xFF, "invalid reference"),
        (start + 8, 0x05, "LZF data of 12000 bytes"),
    ):
        broken = bytearray(data)
        broken[offset] = value
        path.write_bytes(broken)
        with pytest.raises(FormatError, match=complaint):
            read_scan(path)


def test_names_types_and_heights_beyond_the_header_are_not_written(tmp_path):
    path = tmp_path / "a.pcd"
    for name in ("two words", "_", "größe"):
        with pytest.raises(InvalidInput, match="one word"):
            write_scan(path, _POINTS, {name: np.arange(_N)})
    with pytest.raises(InvalidInput, match="complex"):
        write_scan(path, _POINTS, {"phase": np.zeros(_N, complex)})
    with pytest.raises(InvalidInput, match="height must divide"):
        write_scan(path, _POINTS, height=5)
    assert not path.exists()


@pytest.mark.parametrize("size", ["WIDTH 0\nHEIGHT 0\n", "", "HEIGHT 1\n"])
def test_points_without_a_size_of_the_image_are_one_row(save, size):
    scan = read_scan(save("a.pcd", _ASCII.replace("WIDTH 2\nHEIGHT 1\n", size)))
    assert scan.points.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert (scan.width, scan.height) == (2, 1)
    assert "all POINTS read as one row" in scan.notes[0]


def test_a_viewpoint_of_zeros_has_no_rotation(save):
    zeros = _ASCII.replace("VIEWPOINT 0 0 0 1 0 0 0", "VIEWPOINT 1 2 3 0 0 0 0")
    scan = read_scan(save("a.pcd", zeros))
    assert scan.viewpoint == Pose(np.eye(3), [1.0, 2.0, 3.0])
    assert "read as no rotation" in scan.notes[0]


def test_columns_are_chosen_by_name(save):
    path = save("a.pcd", _ASCII.replace("FIELDS x y z", "FIELDS east north up"))
    scan = read_scan(path, columns="x=north y=up z=east")
    assert scan.points.tolist() == [[2, 3, 1], [5, 6, 4]]
    with pytest.raises(FormatError, match="found east, north, up; say which they are, as in"):
        read_scan(path)
    with pytest.raises(FormatError, match="a column 'west', as requested, found 3 columns: east"):
        read_scan(path, columns="x=west y=north z=up")
    with pytest.raises(InvalidInput, match="must be names of PCD, which names its own"):
        read_scan(path, columns=3)
