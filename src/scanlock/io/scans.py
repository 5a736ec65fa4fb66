"""Reading and writing of scans in any format."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.io.atomic import atomic_file
from scanlock.io.columns import Columns, requested_names
from scanlock.io.errors import read_bytes, read_start
from scanlock.io.formats.registry import (
    FORMATS,
    WRITABLE,
    ScanFormat,
    detect_format,
    format_of_name,
    require_format,
)
from scanlock.io.scan_file import ScanFile
from scanlock.io.stations import choose_station, split_station

Encoding = Literal["binary", "ascii", "compressed"]


def read_scan(
    path: str | os.PathLike[str],
    format: str | None = None,
    *,
    columns: Columns = None,
    station: int | str | None = None,
) -> ScanFile:
    """Read a scan from a file.

    Parameters
    ----------
    path : path-like
        The file, or a station of it: ``"site.e57#2"``.
    format : str, optional
        A key of `FORMATS`. By default it is detected from the extension and the content, which
        must agree.
    columns : int or str or sequence of str, optional
        Number (``3``) or names (``"x y z label"``) of the columns of a file without names, or a
        choice among the columns of a file with names (``"x=easting y=northing z=height"``).
        Guessed from the values by default; the guess is recorded in ``notes``.
    station : int or str, optional
        Number (from 1) or name of the scan in a file of several (E57, PTX, PTS).

    Returns
    -------
    ScanFile

    Raises
    ------
    FileNotFoundError
        The file does not exist.
    FormatError
        The file is empty, truncated, mislabelled or malformed, or holds several stations of which
        none is chosen; the message says where, and gives a remedy.
    MissingExtra
        The format needs an optional dependency that is not installed.
    InvalidInput
        An unknown `format` or `station`, or invalid `columns`.
    """
    asked = requested_names(columns)
    path, named = split_station(Path(path))
    known, data = _contents(path, format)
    choice = named if station is None else station
    if choice is None:
        return known.read(path, data, asked)
    if known.stations is None:
        raise InvalidInput(
            f"{path}: station must be left out for {known.title}, which holds one scan, got "
            f"{choice!r}"
        )
    return choose_station(path, known.stations(path, data), choice).read(asked)


def read_scans(
    path: str | os.PathLike[str], format: str | None = None, *, columns: Columns = None
) -> tuple[ScanFile, ...]:
    """Read all stations of a file: of E57, PTX and PTS, or the only scan of another format.

    Parameters
    ----------
    path, format, columns
        As for `read_scan`.

    Returns
    -------
    tuple of ScanFile
        In the order of the file, each in its own frame, with its name and its pose
        ``file_from_station``.

    Raises
    ------
    FormatError
        Also for a station without points.
    FileNotFoundError, MissingExtra, InvalidInput
        As for `read_scan`.
    """
    asked = requested_names(columns)
    path = Path(path)
    known, data = _contents(path, format)
    if known.stations is None:
        return (known.read(path, data, asked),)
    stations = known.stations(path, data)
    if not stations:
        choose_station(path, stations)
    return tuple(station.read(asked) for station in stations)


def write_scan(
    path: str | os.PathLike[str],
    points: ArrayLike,
    fields: Mapping[str, ArrayLike] | None = None,
    format: str | None = None,
    *,
    encoding: Encoding | None = None,
    height: int = 1,
    viewpoint: Pose | None = None,
) -> None:
    """Write a scan to a file, from which `read_scan` returns the same values.

    Parameters
    ----------
    path : path-like
        The file; an existing one is replaced once the new one is complete.
    points : (n, 3) [m]
        float32 is stored as float32, other types as float64 where the format has it. Pass
        ``scan.points.astype(scan.coordinate_dtype)`` to keep the type of a scan that was read.
    fields : mapping of str to (n,) or (n, k), optional
        Further columns.
    format : str, optional
        A key of `FORMATS`; by default given by the extension.
    encoding : {"binary", "ascii", "compressed"}, optional
        By default the first one of the format.
    height : int
        Number of rows of an organised cloud, for PCD.
    viewpoint : Pose, optional
        Pose of the sensor in the frame of the points, for PCD.

    Raises
    ------
    InvalidInput
        No points, or values that the format cannot hold without loss.
    FileNotFoundError
        The folder does not exist.
    """
    path = Path(path)
    name = format_of_name(path) if format is None else require_format(format)
    if name is None:
        raise InvalidInput(
            f"the extension of {path.name} must be that of a scan format; use another, or pass "
            f"format= as one of {', '.join(FORMATS)}"
        )
    known = FORMATS[name]
    if known.write is None:
        raise InvalidInput(
            f"{path}: {known.title} cannot be written; the formats that can are "
            f"{', '.join(WRITABLE)}"
        )
    chosen = known.encodings[0] if encoding is None else encoding
    if chosen not in known.encodings:
        raise InvalidInput(
            f"encoding of {name} must be one of {', '.join(known.encodings)}, got {encoding!r}"
        )
    if not known.organised and (height != 1 or viewpoint is not None):
        raise InvalidInput(
            f"height and viewpoint cannot be written as {name}; write .pcd, or leave them out"
        )
    scan = _scan_to_write(points, fields or {}, name, height, viewpoint)
    with atomic_file(path) as handle:
        known.write(path, handle, scan, chosen)


def write_scans(
    path: str | os.PathLike[str], scans: Sequence[ScanFile], format: str | None = None
) -> None:
    """Write several stations to one file, each with its fields, name and pose.

    Parameters
    ----------
    path : path-like
        The file; an existing one is replaced once the new one is complete.
    scans : sequence of ScanFile
        Stations in the frames of their scanners, with ``file_from_station``; a missing pose is
        left out (E57) or no motion (PTX).
    format : {"e57", "ptx"}, optional
        By default given by the extension.

    Raises
    ------
    InvalidInput
        No scans, another format, or values that the format cannot hold.
    MissingExtra
        The format needs an optional dependency that is not installed.
    FileNotFoundError
        The folder does not exist.
    """
    path = Path(path)
    name = format_of_name(path) if format is None else require_format(format)
    write = None if name is None else FORMATS[name].write_stations
    if write is None:
        able = [key for key, known in FORMATS.items() if known.write_stations is not None]
        raise InvalidInput(
            f"{path}: stations can be written as {' or '.join(able)} only; use such an extension, "
            "or one file for each with write_scan"
        )
    if not scans:
        raise InvalidInput("scans must hold at least one scan to be written, got none")
    with atomic_file(path) as handle:
        write(path, handle, scans)


def _contents(path: Path, format: str | None) -> tuple[ScanFormat, bytes]:
    """Return the format of a file, and its contents or, if the reader opens it, its beginning."""
    start = read_start(path, "scan")
    known = FORMATS[detect_format(path, start, format)]
    return known, start if known.opens_files else read_bytes(path, "scan")


def _scan_to_write(
    points: ArrayLike,
    fields: Mapping[str, ArrayLike],
    name: str,
    height: int,
    viewpoint: Pose | None,
) -> ScanFile:
    array = np.asarray(points)
    if array.ndim != 2 or array.shape[1] != 3 or array.dtype.kind not in "fiu":
        raise InvalidInput(
            f"points must be real numbers of shape (n, 3), got {array.dtype} {array.shape}; "
            "pass further columns as fields"
        )
    if len(array) == 0:
        raise InvalidInput("points must hold at least one row to be written, got none")
    if height < 1 or len(array) % height:
        raise InvalidInput(f"height must divide the {len(array)} points, got {height}")
    columns: dict[str, Any] = {key: np.asarray(values) for key, values in fields.items()}
    return ScanFile(
        points=np.ascontiguousarray(array, dtype=np.float64),
        fields=columns,
        format=name,
        coordinate_dtype="float32" if array.dtype == np.float32 else "float64",
        width=len(array) // height,
        height=height,
        viewpoint=viewpoint,
    )
