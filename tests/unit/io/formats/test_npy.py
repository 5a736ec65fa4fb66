import io
import pickle
import zipfile

import numpy as np
import pytest

from scanlock.errors import FormatError, InvalidInput
from scanlock.io import read_scan, write_scan

_POINTS = np.random.default_rng(0).normal(size=(6, 3))


def _npy(array, **options):
    stream = io.BytesIO()
    np.save(stream, array, **options)
    return stream.getvalue()


def _npz(**arrays):
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    return stream.getvalue()


@pytest.mark.parametrize("dtype", ["<f8", "<f4", ">f8", "<i2"])
@pytest.mark.parametrize("order", ["C", "F"])
def test_plain_arrays_are_read(save, dtype, order):
    array = np.asarray(_POINTS * 100, dtype=dtype, order=order)
    scan = read_scan(save("a.npy", _npy(array)))
    assert np.array_equal(scan.points, array)
    assert scan.coordinate_dtype == np.dtype(dtype).newbyteorder("=").name


def test_unnamed_columns_are_numbered_and_can_be_named(save):
    wide = np.column_stack([_POINTS, np.arange(6), np.ones(6)])
    path = save("a.npy", _npy(wide))
    assert list(read_scan(path).fields) == ["column_4", "column_5"]
    named = read_scan(path, columns="ring x y z t")
    assert np.array_equal(named.points, wide[:, 1:4])
    assert list(named.fields) == ["ring", "t"]
    with pytest.raises(FormatError, match="3 columns, as requested, found 5"):
        read_scan(path, columns="x y z")


def test_structured_arrays_are_read(save):
    table = np.zeros(6, dtype=[("t", "<u8"), ("x", "f4"), ("y", "f4"), ("z", "f4")])
    table["t"] = 2**63 + np.arange(6, dtype=np.uint64)
    table["y"] = 7
    scan = read_scan(save("a.npy", _npy(table)))
    assert np.array_equal(scan.fields["t"], table["t"])
    assert scan.points[:, 1].tolist() == [7] * 6
    archive = read_scan(save("a.npz", _npz(z=_POINTS[:, 2], x=_POINTS[:, 0], y=_POINTS[:, 1])))
    assert np.array_equal(archive.points, _POINTS)


def test_archives_are_read_and_skipped_arrays_noted(save):
    path = save("a.npz", _npz(points=_POINTS, ring=np.arange(6), calibration=np.eye(4)))
    scan = read_scan(path)
    assert np.array_equal(scan.points, _POINTS)
    assert list(scan.fields) == ["ring"]
    assert "calibration of shape (4, 4) left out" in scan.notes[0]
    assert np.array_equal(read_scan(save("b.npz", _npz(scan=_POINTS))).points, _POINTS)


@pytest.mark.parametrize("name", ["a.npy", "a.npz"])
@pytest.mark.parametrize("dtype", ["f8", "f4"])
def test_round_trip(tmp_path, name, dtype):
    points = _POINTS.astype(dtype)
    points[2, 1] = np.nan
    fields = {
        "t": np.arange(6, dtype=np.uint64) + 2**63,
        "normal": np.ones((6, 3), np.float32),
        "ok": np.arange(6) % 2 == 0,
    }
    write_scan(tmp_path / name, points, fields)
    again = read_scan(tmp_path / name)
    assert np.array_equal(again.points, points, equal_nan=True)
    assert again.coordinate_dtype == points.dtype.name
    assert {key: value.dtype for key, value in again.fields.items()} == {
        key: value.dtype for key, value in fields.items()
    }
    for key, value in fields.items():
        assert np.array_equal(again.fields[key], value)


def test_numpy_reads_the_written_files(tmp_path):
    write_scan(tmp_path / "a.npy", _POINTS)
    assert np.array_equal(np.load(tmp_path / "a.npy"), _POINTS)
    write_scan(tmp_path / "a.npz", _POINTS, {"ring": np.arange(6)}, encoding="compressed")
    with np.load(tmp_path / "a.npz") as archive:
        assert np.array_equal(archive["points"], _POINTS)
        assert np.array_equal(archive["ring"], np.arange(6))


class _PickleBomb:
    def __reduce__(self):
        return exec, ("raise AssertionError('unpickled')",)


def test_pickled_objects_are_refused(save):
    with pytest.raises(FormatError, match="object"):
        read_scan(save("a.npy", _npy(np.array([_PickleBomb()], dtype=object), allow_pickle=True)))
    with pytest.raises(FormatError):
        read_scan(save("b.npy", pickle.dumps(_PickleBomb())), format="npy")


@pytest.mark.parametrize(
    ("array", "complaint"),
    [
        (np.zeros((6, 2)), "shape \\(6, 2\\)"),
        (np.zeros(6), "shape \\(6,\\)"),
        (np.zeros((6, 3), complex), "complex128"),
        (np.zeros((6, 3), bool), "bool"),
        (np.zeros((0, 3)), "at least one point"),
        (np.zeros(6, dtype=[("a", "f8"), ("b", "f8")]), "columns named x, y and z, found a, b"),
        (
            np.zeros(2, dtype=[("x", "f8", 2), ("y", "f8"), ("z", "f8")]),
            "one number per point for x",
        ),
    ],
)
def test_arrays_that_are_no_scan_are_refused(save, array, complaint):
    with pytest.raises(FormatError, match=complaint):
        read_scan(save("a.npy", _npy(array)))


def test_sizes_that_differ_from_the_header_are_refused(save):
    data = _npy(_POINTS)
    with pytest.raises(FormatError, match="byte 128: expected 144 bytes"):
        read_scan(save("a.npy", data[:-1]))
    with pytest.raises(FormatError, match="found 145"):
        read_scan(save("a.npy", data + b"\0"))


def test_archives_without_points_are_refused(save):
    with pytest.raises(FormatError, match="found a, b"):
        read_scan(save("a.npz", _npz(a=_POINTS, b=_POINTS)))
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr("readme.txt", "no array")
    with pytest.raises(FormatError):
        read_scan(save("b.npz", stream.getvalue()))


def test_reserved_names_are_not_written(tmp_path):
    with pytest.raises(InvalidInput, match="cannot be named points"):
        write_scan(tmp_path / "a.npz", _POINTS, {"points": np.arange(6)})


def test_columns_of_structured_arrays_are_chosen_by_name(save):
    table = np.zeros(6, dtype=[("t", "<u8"), ("east", "f4"), ("north", "f4"), ("h", "f4")])
    table["north"] = 7
    path = save("a.npy", _npy(table))
    scan = read_scan(path, columns="x=east y=north z=h")
    assert scan.points[:, 1].tolist() == [7] * 6
    assert list(scan.fields) == []
    archive = save("a.npz", _npz(east=table["east"], north=table["north"], h=table["h"]))
    assert np.array_equal(read_scan(archive, columns="x=east y=north z=h").points, scan.points)
    with pytest.raises(InvalidInput, match="must be names of a NumPy file with named columns"):
        read_scan(path, columns=4)
