"""NumPy files: one array (.npy), or several named ones (.npz)."""

import io
import math
import struct
import warnings
import zipfile
import zlib
from pathlib import Path
from tokenize import TokenError
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from scanlock.errors import FormatError, InvalidInput
from scanlock.io.column_order import refuse_other_order
from scanlock.io.columns import (
    Request,
    find_coordinates,
    numbered_names,
    require_request_of_names,
    select_columns,
)
from scanlock.io.errors import malformed
from scanlock.io.scan_file import ScanFile, scan_from_columns

_ZIP_ERRORS = (
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
    EOFError,
    LookupError,
    OSError,
    RuntimeError,
    ValueError,
)
"""Errors that the standard library raises on damaged archives (found by experiment)."""

_POINT_KEYS = ("points", "xyz", "arr_0")
"""Names of the points in .npz files, in order of preference."""


def read_npy(path: Path, data: bytes, columns: Request) -> ScanFile:
    """Read a plain (n, 3+) array, or a structured array with x, y and z."""
    array = array_from_npy(path, data)
    names, parts = _split(path, array, columns)
    return scan_from_columns(path, names, parts, format="npy", encoding="binary")


def read_npz(path: Path, data: bytes, columns: Request) -> ScanFile:
    """Read the arrays x, y, z, or one of points, xyz and arr_0; other arrays become fields.

    Arrays without a row for each point are left out, with a note.
    """
    names, parts = _named_arrays(path, data, columns)
    first = (find_coordinates(names) or (0,))[0]
    count = len(parts[first]) if parts[first].ndim else 0
    fitting = [part.ndim in (1, 2) and len(part) == count for part in parts]
    return scan_from_columns(
        path,
        [name for name, fits in zip(names, fitting, strict=True) if fits],
        [part for part, fits in zip(parts, fitting, strict=True) if fits],
        format="npz",
        encoding="binary",
        notes=tuple(
            f"array {name} of shape {part.shape} left out: it has no row for each point"
            for name, part, fits in zip(names, parts, fitting, strict=True)
            if not fits
        ),
    )


def write_npy(path: Path, handle: BinaryIO, scan: ScanFile, encoding: str) -> None:
    """Write an (n, 3) array, or for scans with fields a structured array of named columns."""
    points = scan.points.astype(scan.coordinate_dtype)
    if not scan.fields:
        np.lib.format.write_array(handle, points, allow_pickle=False)
        return
    layout: list[Any] = [(axis, points.dtype) for axis in "xyz"]
    layout += [(name, values.dtype, values.shape[1:]) for name, values in scan.fields.items()]
    table = np.empty(len(points), dtype=layout)
    for k, axis in enumerate("xyz"):
        table[axis] = points[:, k]
    for name, values in scan.fields.items():
        table[name] = values
    np.lib.format.write_array(handle, table, allow_pickle=False)


def write_npz(path: Path, handle: BinaryIO, scan: ScanFile, encoding: str) -> None:
    """Write an array ``points`` and one array for each field."""
    taken = sorted({"points", "file", "allow_pickle"} & set(scan.fields))
    if taken:
        raise InvalidInput(f"{path}: a field of .npz cannot be named {taken[0]}; rename it")
    arrays: dict[str, Any] = {"points": scan.points.astype(scan.coordinate_dtype), **scan.fields}
    save = np.savez_compressed if encoding == "compressed" else np.savez
    save(handle, **arrays)


def array_from_npy(path: Path, data: bytes) -> NDArray[Any]:
    """Return the array in the bytes of an .npy file; Python objects are never unpickled.

    Raises
    ------
    FormatError
        An invalid header, Python objects, or another number of bytes than the header gives.
    """
    stream = io.BytesIO(data)
    try:
        version = np.lib.format.read_magic(stream)
        read_header = (
            np.lib.format.read_array_header_1_0
            if version == (1, 0)
            else np.lib.format.read_array_header_2_0
        )
        # NumPy warns about headers of old or damaged files.
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            shape, fortran_order, dtype = read_header(stream)
    # NumPy parses the header as Python source, with all of its errors.
    except (ValueError, SyntaxError, TypeError, MemoryError, TokenError) as error:
        raise FormatError(
            f"{path}: byte 0: expected the header of a NumPy array, found an invalid one "
            f"({error}); the file is cut short or damaged: save it again with numpy.save"
        ) from error
    if dtype.hasobject or dtype.itemsize == 0 or min(shape, default=0) < 0:
        raise malformed(
            path,
            "header",
            expected="an array of numbers",
            found=f"{dtype} of shape {shape}",
            remedy="save it as a plain float array",
        )
    offset = stream.tell()
    expected = math.prod(shape) * dtype.itemsize
    if len(data) - offset != expected:
        raise malformed(
            path,
            f"byte {offset}",
            expected=f"{expected} bytes for {dtype} of shape {shape}",
            found=f"{len(data) - offset}",
            remedy="the file is cut short or damaged; copy or save it again",
        )
    if expected == 0:
        return np.empty(shape, dtype)
    array = np.frombuffer(data, dtype=dtype, count=math.prod(shape), offset=offset)
    return array.reshape(shape, order="F" if fortran_order else "C")


def _named_arrays(
    path: Path, data: bytes, columns: Request
) -> tuple[list[str], list[NDArray[Any]]]:
    arrays = _members(path, data)
    key = next((key for key in _POINT_KEYS if key in arrays), None)
    if key is None and len(arrays) == 1:
        key = next(iter(arrays))
    if find_coordinates(list(arrays)) is not None or (key is None and isinstance(columns, tuple)):
        return _chosen(path, arrays, columns)
    if key is None:
        raise malformed(
            path,
            "contents",
            expected=f"arrays x, y, z, or one named {' or '.join(_POINT_KEYS)}",
            found=", ".join(arrays) or "none",
            remedy="save it again under one of these names",
        )
    names, parts = _split(path, arrays.pop(key), columns)
    return [*names, *arrays], [*parts, *arrays.values()]


def _members(path: Path, data: bytes) -> dict[str, NDArray[Any]]:
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            return {
                name.removesuffix(".npy"): array_from_npy(path, archive.read(name))
                for name in archive.namelist()
            }
    except FormatError:
        raise
    except _ZIP_ERRORS as error:
        raise FormatError(
            f"{path}: expected a zip archive of NumPy arrays, found an invalid one ({error}); the "
            "file is cut short or damaged: save it again with numpy.savez"
        ) from error


def _split(
    path: Path, array: NDArray[Any], columns: Request
) -> tuple[list[str], list[NDArray[Any]]]:
    if array.dtype.names is not None:
        if array.ndim != 1:
            raise malformed(
                path,
                "header",
                expected="a one-dimensional structured array",
                found=f"shape {array.shape}",
                remedy="save a one-dimensional array",
            )
        return _chosen(path, {name: array[name] for name in array.dtype.names}, columns)
    if array.ndim != 2 or array.shape[1] < 3 or array.dtype.kind not in "fiu":
        raise malformed(
            path,
            "header",
            expected="real numbers of shape (n, 3) or wider",
            found=f"{array.dtype} of shape {array.shape}",
            remedy="save one row per point",
        )
    if columns is None:
        refuse_other_order(path, list(array.T))
    chosen = select_columns(path, numbered_names(array.shape[1]), columns, named=False)
    return [name for name, _ in chosen], [array[:, index] for _, index in chosen]


def _chosen(
    path: Path, arrays: dict[str, NDArray[Any]], columns: Request
) -> tuple[list[str], list[NDArray[Any]]]:
    """Return the names and values of the columns that are wanted of those with names."""
    require_request_of_names(path, "a NumPy file with named columns", columns)
    chosen = select_columns(path, list(arrays), columns)
    parts = list(arrays.values())
    return [name for name, _ in chosen], [parts[index] for _, index in chosen]
