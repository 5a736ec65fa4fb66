"""Files round-trip; truncated or damaged files are never read as smaller scans."""

import contextlib
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from scanlock.errors import FormatError
from scanlock.geometry.pose import Pose
from scanlock.io import (
    ScanFile,
    read_kitti_poses,
    read_labels,
    read_pose,
    read_scan,
    read_scans,
    read_tum_poses,
    write_kitti_poses,
    write_labels,
    write_pose,
    write_scan,
    write_scans,
    write_tum_poses,
)

pytestmark = pytest.mark.slow

_VARIANTS = [
    ("a.pcd", "ascii"),
    ("a.pcd", "binary"),
    ("a.pcd", "compressed"),
    ("a.ply", "ascii"),
    ("a.ply", "binary"),
    ("a.npy", None),
    ("a.npz", None),
    ("a.npz", "compressed"),
    ("a.csv", None),
    ("a.xyz", None),
    ("a.pts", None),
    ("a.vtk", "ascii"),
    ("a.vtk", "binary"),
]
_COUNTED = [variant for variant in _VARIANTS if variant[0] not in ("a.csv", "a.xyz", "a.vtk")]
"""Formats that store the number of points, with nothing optional after them."""

_FIELD_TYPES = ["i1", "i2", "i4", "u1", "u2", "u4", "f4", "f8"]


@pytest.fixture(scope="module")
def folder():
    with tempfile.TemporaryDirectory() as name:
        yield Path(name)


def _arrays(dtype, shape):
    kind = np.dtype(dtype)
    if kind.kind == "f":
        values = st.floats(width=8 * kind.itemsize, allow_nan=True, allow_infinity=True)
        return hnp.arrays(kind, shape, elements=values)
    return hnp.arrays(kind, shape)


@st.composite
def _scans(draw):
    n = draw(st.integers(1, 12))
    points = draw(_arrays(draw(st.sampled_from(["f4", "f8"])), (n, 3)))
    names = draw(st.lists(st.sampled_from(["ring", "t", "i", "n"]), unique=True, max_size=3))
    fields = {name: draw(_arrays(draw(st.sampled_from(_FIELD_TYPES)), (n,))) for name in names}
    return points, fields


_STEPS = hnp.arrays(np.float64, 6, elements=st.floats(-3, 3)).map(
    lambda step: Pose.from_step(step * [1e6, 1e6, 1e3, 1, 1, 1])
)


@pytest.mark.parametrize(("name", "encoding"), _VARIANTS)
@given(scan=_scans())
@settings(max_examples=25)
def test_round_trip(folder, name, encoding, scan):
    points, fields = scan
    path = folder / name
    write_scan(path, points, fields, encoding=encoding)
    names = " ".join(["x", "y", "z", *fields]) if name == "a.pts" else None
    again = read_scan(path, columns=names)
    assert np.array_equal(again.points.astype(points.dtype), points, equal_nan=True)
    assert list(again.fields) == list(fields)
    for key, values in fields.items():
        # Text has no types: only the values are compared.
        back = again.fields[key].astype(values.dtype)
        assert np.array_equal(back, values, equal_nan=values.dtype.kind == "f")
        if name not in ("a.csv", "a.xyz", "a.pts"):
            assert again.fields[key].dtype == values.dtype


@pytest.mark.parametrize("name", ["a.e57", "a.ptx"])
@given(scans=st.lists(st.tuples(_scans(), st.none() | _STEPS), min_size=1, max_size=3))
@settings(max_examples=25)
def test_stations_round_trip(folder, name, scans):
    if name == "a.e57":
        pytest.importorskip("pye57")
    stations = [
        ScanFile(
            points=points.astype(np.float64),
            fields=fields if name == "a.e57" else {},
            format="pcd",
            coordinate_dtype=points.dtype.name,
            file_from_station=pose,
        )
        for (points, fields), pose in scans
    ]
    write_scans(folder / name, stations)
    again = read_scans(folder / name)
    blank = np.nan if name == "a.e57" else 0.0
    for one, back in zip(stations, again, strict=True):
        finite = np.isfinite(one.points).all(axis=1)
        # Text has the shortest digits of a type.
        stored = back.points.astype(one.coordinate_dtype)
        assert np.array_equal(stored[finite], one.points[finite])
        assert np.array_equal(
            back.points[~finite], np.full(((~finite).sum(), 3), blank), equal_nan=True
        )
        expected = one.file_from_station or (None if name == "a.e57" else Pose.identity())
        assert (back.file_from_station is None) == (expected is None)
        if expected is not None:
            assert expected.is_close(back.file_from_station, translation=0, rotation=1e-14)
        for key, values in one.fields.items():
            assert np.array_equal(back.fields[key], values, equal_nan=values.dtype.kind == "f")


def _example(path, encoding):
    rng = np.random.default_rng(0)
    points = rng.normal(size=(20, 3)) * 30
    write_scan(path, points, {"ring": np.arange(20, dtype=np.uint8)}, encoding=encoding)
    return points, path.read_bytes()


@pytest.mark.parametrize(("name", "encoding"), _COUNTED)
def test_truncated_files_are_never_read_as_smaller_scans(folder, name, encoding):
    path = folder / name
    points, data = _example(path, encoding)
    for end in range(1, len(data)):
        path.write_bytes(data[:end])
        try:
            scan = read_scan(path)
        except FormatError:
            continue
        # Text may lose digits of its last number; the missing line end is noted.
        assert b"\n" not in data[end:-1]
        assert len(scan) == len(points)
        assert "no line end" in scan.notes[0]


@pytest.mark.parametrize("name", ["a.csv", "a.xyz"])
def test_truncated_tables_without_a_count_lose_whole_lines_only(folder, name):
    path = folder / name
    _, data = _example(path, None)
    for end in range(1, len(data)):
        path.write_bytes(data[:end])
        try:
            scan = read_scan(path)
        except FormatError:
            continue
        assert len(scan) == data[:end].count(b"\n") - 1 + bool(scan.notes)


@pytest.mark.parametrize(("name", "encoding"), _VARIANTS)
@given(data=st.data())
def test_damaged_files_are_read_or_raise_a_format_error(folder, name, encoding, data):
    path = folder / name
    _, content = _example(path, encoding)
    damaged = bytearray(content)
    for _ in range(data.draw(st.integers(1, 3))):
        offset = data.draw(st.integers(0, len(damaged) - 1))
        remainder = data.draw(st.integers(0, 3))
        damaged[offset : offset + 2 - remainder] = data.draw(st.binary(max_size=3))
    path.write_bytes(damaged)
    with contextlib.suppress(FormatError):
        assert len(read_scan(path)) > 0


@given(content=st.binary(min_size=1, max_size=200), suffix=st.sampled_from(["pcd", "ply", "npy"]))
def test_arbitrary_content_raises_format_errors_only(folder, content, suffix):
    magic = {
        "pcd": b"# .PCD\nVERSION 0.7\n",
        "ply": b"ply\nformat ascii 1.0\n",
        "npy": b"\x93NUMPY",
    }
    for name, head in ((suffix, magic[suffix]), ("txt", b""), ("bin", b""), ("npz", b"PK\3\4")):
        path = folder / f"b.{name}"
        path.write_bytes(head + content)
        with contextlib.suppress(FormatError):
            assert len(read_scan(path)) > 0


@given(poses=st.lists(_STEPS, min_size=1, max_size=4), start=st.floats(0, 2e9))
def test_poses_round_trip(folder, poses, start):
    path = folder / "poses.txt"
    times = start + 0.1 * np.arange(len(poses))
    write_pose(path, poses[0])
    assert poses[0].is_close(read_pose(path), translation=0, rotation=1e-15)
    write_kitti_poses(path, poses)
    for pose, again in zip(poses, read_kitti_poses(path), strict=True):
        assert pose.is_close(again, translation=0, rotation=1e-15)
    write_tum_poses(path, times, poses)
    stamps, read = read_tum_poses(path)
    assert np.array_equal(stamps, times)
    for pose, again in zip(poses, read, strict=True):
        assert pose.is_close(again, translation=0, rotation=1e-14)


@given(
    labels=hnp.arrays(np.int64, st.integers(1, 20)), suffix=st.sampled_from(["npy", "txt", "csv"])
)
def test_labels_round_trip(folder, labels, suffix):
    path = folder / f"labels.{suffix}"
    write_labels(path, labels)
    assert np.array_equal(read_labels(path, count=len(labels)), labels)
