"""Reading and writing of single scans in any format."""

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from scanlock.arrays import Vector
from scanlock.errors import InvalidInput, require_positive
from scanlock.geometry.pose import Pose
from scanlock.io.atomic import atomic_file
from scanlock.io.columns import Columns, requested_names
from scanlock.io.crs.coordinate_system import unit_notes
from scanlock.io.formats.registry import (
    FORMATS,
    WRITABLE,
    format_of_name,
    open_contents,
    require_format,
)
from scanlock.io.formats.stations import choose_station, split_station
from scanlock.io.scan_file import ScanFile

Encoding = Literal["binary", "ascii", "compressed"]

_MAX_ROUNDING = 1e-4
"""Maximum rounding of the coordinates of a scan [m] by which they stay float32."""


def read_scan(
    path: str | os.PathLike[str],
    format: str | None = None,
    *,
    columns: Columns = None,
    station: int | str | None = None,
    scale: float | None = None,
) -> ScanFile:
    """Read a scan from a file, in metres.

    LAS files in feet are converted to metres, and their unit is kept in ``crs``. Longitude and
    latitude stay degrees.

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
    scale : float, optional [m]
        Size of the unit of the file, in place of the one that the file states: 0.001 for
        millimetres.

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
        An unknown `format` or `station`, invalid `columns`, or a `scale` that is not positive or
        for degrees.
    """
    asked = requested_names(columns)
    if scale is not None:
        require_positive("scale", scale, "m")
    path, named = split_station(Path(path))
    known, data = open_contents(path, format)
    choice = named if station is None else station
    if choice is None:
        scan = known.read(path, data, asked)
    elif known.stations is None:
        raise InvalidInput(
            f"{path}: station must be left out for {known.title}, which holds one scan, got "
            f"{choice!r}"
        )
    else:
        scan = choose_station(path, known.stations(path, data), choice).read(asked)
    return scan if scale is None else rescaled(scan, scale)


def rescaled(scan: ScanFile, scale: float) -> ScanFile:
    """Return a scan whose file has another unit [m] than the reader took."""
    crs = scan.crs
    stated = () if crs is None else unit_notes(crs)
    if crs is not None and (crs.is_geographic or crs.metres_per_unit == scan.metres_per_unit):
        crs = crs.with_unit(scale)
    factors = scale / np.array(scan.metres_per_unit)
    return replace(
        scan,
        points=scan.points * factors,
        crs=crs,
        viewpoint=_rescaled_pose(scan.viewpoint, factors),
        file_from_station=_rescaled_pose(scan.file_from_station, factors),
        metres_per_unit=(scale,) * 3,
        notes=(
            *(note for note in scan.notes if note not in stated),
            f"read in units of {scale:g} m, as asked",
        ),
    )


def _rescaled_pose(pose: Pose | None, factors: Vector) -> Pose | None:
    return None if pose is None else Pose(pose.rotation, pose.translation * factors)


def write_scan(
    path: str | os.PathLike[str],
    points: ArrayLike | ScanFile,
    fields: Mapping[str, ArrayLike] | None = None,
    format: str | None = None,
    *,
    encoding: Encoding | None = None,
    height: int = 1,
    viewpoint: Pose | None = None,
) -> None:
    """Write a scan to a file, from which `read_scan` returns the same values.

    Coordinates are written in metres, and in the unit of its ``crs`` for LAS. Of a `ScanFile`, the
    format's part is written: every field, for PCD the organisation and viewpoint, for LAS the
    coordinate reference system, version, point format, records and extra dimensions.

    Parameters
    ----------
    path : path-like
        The file; an existing one is replaced once the new one is complete.
    points : (n, 3) [m] or ScanFile
        float32 is stored as float32, other types as float64 where the format has it. The
        coordinates of a `ScanFile` that was read from float32 stay float32 where that rounds them
        by less than 0.1 mm.
    fields : mapping of str to (n,) or (n, k), optional
        Further columns. A `ScanFile` has its own; change them by `dataclasses.replace`.
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
        No points, values that the format cannot hold without loss, or `fields`, `height` or
        `viewpoint` beside a `ScanFile`.
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
    if isinstance(points, ScanFile):
        if fields is not None or height != 1 or viewpoint is not None:
            raise InvalidInput(
                "fields, height and viewpoint must not be given beside a ScanFile, which has its "
                "own; use dataclasses.replace(scan, fields=...)"
            )
        scan = scan_in_format(points, name)
    else:
        scan = _scan_to_write(points, fields or {}, name, height, viewpoint)
    with atomic_file(path) as handle:
        known.write(path, handle, scan, chosen)


def scan_in_format(scan: ScanFile, name: str) -> ScanFile:
    """Return a scan for the writer of a format, with float32 or float64 coordinates."""
    is_short = scan.coordinate_dtype in ("float32", "float16")
    if is_short:
        finite = scan.points[np.isfinite(scan.points)]
        with np.errstate(over="ignore"):
            rounding = np.abs(finite.astype(np.float32) - finite).max(initial=0.0)
        is_short = rounding <= _MAX_ROUNDING
    return replace(scan, format=name, coordinate_dtype="float32" if is_short else "float64")


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
