import sys

import numpy as np
import pytest

from scanlock.errors import FormatError, InvalidInput, MissingExtra
from scanlock.io import read_scan, write_scan

laspy = pytest.importorskip("laspy")

_N = 200
_RNG = np.random.default_rng(3)
_CORNER = np.array([512_345.0, 5_403_210.0, 120.0])
_POINTS = _CORNER + np.round(_RNG.random((_N, 3)) * 300, 4)
_FIELDS = {
    "intensity": _RNG.integers(0, 2**16, _N, dtype=np.uint16),
    "classification": _RNG.integers(0, 256, _N, dtype=np.uint8),
    "return_number": _RNG.integers(0, 16, _N, dtype=np.uint8),
    "gps_time": _RNG.random(_N) * 1e8,
    "range": _RNG.random(_N).astype(np.float32),
    "tree": _RNG.integers(-(2**40), 2**40, _N),
    "ground": _RNG.random(_N) > 0.5,
}


@pytest.mark.parametrize("name", ["a.las", "a.laz"])
def test_round_trip_to_a_tenth_of_a_millimetre(tmp_path, name):
    path = tmp_path / name
    write_scan(path, _POINTS, _FIELDS)
    scan = read_scan(path)
    assert scan.encoding == ("compressed" if name == "a.laz" else "binary")
    assert np.abs(scan.points - _POINTS).max() < 1e-6
    for key, values in _FIELDS.items():
        assert np.array_equal(scan.fields[key], values)
    assert scan.fields["ground"].dtype == np.uint8
    assert scan.fields["tree"].dtype == np.int64


def test_laspy_reads_the_written_values(tmp_path):
    write_scan(tmp_path / "a.las", _POINTS, _FIELDS | {k: np.arange(_N) for k in ("red", "green")})
    colours = {k: np.arange(_N, dtype=np.uint16) for k in ("red", "green", "blue")}
    write_scan(tmp_path / "b.las", _POINTS, colours)
    with laspy.open(tmp_path / "b.las") as handle:
        assert handle.header.point_format.id == 7
        assert np.array_equal(handle.read().red, colours["red"])
    plain = laspy.read(tmp_path / "a.las")
    assert plain.header.point_format.id == 6
    assert np.abs(np.asarray(plain.x) - _POINTS[:, 0]).max() < 1e-6
    assert np.array_equal(plain["green"], np.arange(_N))


def test_a_wide_extent_gets_a_coarser_step(tmp_path):
    wide = _POINTS.copy()
    wide[0] += 5e6
    write_scan(tmp_path / "a.las", wide)
    assert np.abs(read_scan(tmp_path / "a.las").points - wide).max() <= 0.005 + 1e-9
    write_scan(tmp_path / "b.las", np.zeros((1, 3)))
    assert read_scan(tmp_path / "b.las").points.tolist() == [[0, 0, 0]]


@pytest.mark.parametrize(
    ("points", "fields", "complaint"),
    [
        (np.full((2, 3), np.nan), {}, "NaN or Inf"),
        (np.ones((2, 3)), {"classification": [1, 256]}, "classification cannot hold"),
        (np.ones((2, 3)), {"return_number": [1, 99]}, "return_number cannot hold"),
        (np.ones((2, 3)), {"intensity": [0.5, 1.0]}, "intensity cannot hold"),
        (np.ones((2, 3)), {"a" * 33: [1, 2]}, "must have 1 to 32 bytes"),
        (np.ones((2, 3)), {"X": [1, 2]}, "not be x, y or z"),
        (np.ones((2, 3)), {"h": np.ones(2, np.float16)}, "field h of type float16"),
    ],
)
def test_values_that_las_cannot_hold_are_not_written(tmp_path, points, fields, complaint):
    with pytest.raises(InvalidInput, match=complaint):
        write_scan(tmp_path / "a.las", points, fields)
    assert not (tmp_path / "a.las").exists()


@pytest.mark.parametrize("name", ["a.las", "a.laz"])
def test_truncated_files_are_refused(tmp_path, name):
    path = tmp_path / name
    write_scan(path, _POINTS[:40], {"intensity": _FIELDS["intensity"][:40]})
    data = path.read_bytes()
    for end in (*range(1, len(data), 37), len(data) - 1):
        path.write_bytes(data[:end])
        with pytest.raises(FormatError):
            read_scan(path, format="las")


@pytest.mark.parametrize(
    ("offset", "complaint"),
    [
        (94, "for the header"),
        (96, "for the header"),
        (100, "for the variable length records"),
        (243, "for the extended variable length records"),
        (250, "points"),
        (105, "points"),
    ],
)
def test_a_damaged_count_is_refused_before_memory_is_allocated(tmp_path, offset, complaint):
    path = tmp_path / "a.las"
    write_scan(path, _POINTS)
    data = bytearray(path.read_bytes())
    data[offset : offset + 2] = b"\xff\xff"
    path.write_bytes(data)
    with pytest.raises(FormatError, match=complaint):
        read_scan(path)


def test_a_damaged_chunk_table_is_refused_before_memory_is_allocated(tmp_path):
    path = tmp_path / "a.laz"
    write_scan(path, _POINTS)
    data = bytearray(path.read_bytes())
    start = int.from_bytes(data[96:100], "little")
    table = int.from_bytes(data[start : start + 8], "little")
    for offset, complaint in ((start + 6, "offset of a chunk table"), (table + 7, "chunks")):
        broken = bytearray(data)
        broken[offset] = 0x7F
        path.write_bytes(broken)
        with pytest.raises(FormatError, match=complaint):
            read_scan(path)


def test_missing_dependencies_are_named_with_their_extra(tmp_path, monkeypatch):
    write_scan(tmp_path / "a.laz", _POINTS)
    monkeypatch.setattr(laspy.LazBackend, "detect_available", lambda: ())
    with pytest.raises(MissingExtra, match=r'pip install "scanlock\[las\]"'):
        read_scan(tmp_path / "a.laz")
    monkeypatch.setitem(sys.modules, "laspy", None)
    for action in (
        lambda: read_scan(tmp_path / "a.laz"),
        lambda: write_scan(tmp_path / "b.las", _POINTS),
    ):
        with pytest.raises(MissingExtra, match=r'pip install "scanlock\[las\]"'):
            action()
    assert not (tmp_path / "b.las").exists()


def test_columns_and_empty_files_are_refused(tmp_path):
    path = tmp_path / "a.las"
    write_scan(path, _POINTS)
    with pytest.raises(InvalidInput, match="columns must not be given for LAS"):
        read_scan(path, columns=3)
    laspy.LasData(laspy.LasHeader(version="1.2", point_format=0)).write(path)
    with pytest.raises(FormatError, match="expected 1 points, found 0"):
        read_scan(path)
