"""Read and write one scan, whatever the format."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.io.atomic import atomic_file
from scanlock.io.columns import Columns, requested_names
from scanlock.io.errors import read_bytes
from scanlock.io.formats.registry import FORMATS, format_of_name, require_format, settled_format
from scanlock.io.scan_file import ScanFile

Encoding = Literal["binary", "ascii", "compressed"]


def read_scan(
    path: str | os.PathLike[str], format: str | None = None, *, columns: Columns = None
) -> ScanFile:
    """Return the contents of a scan file.

    Parameters
    ----------
    path : path-like
        The file.
    format : str, optional
        A key of `FORMATS`. By default the ending of the name and the content decide, and must
        agree.
    columns : int or sequence of str, optional
        How many columns a headerless file has (``3``), or what they are called (``"x y z
        label"``). Guessed from the values by default; the guess stands in ``notes``.

    Raises
    ------
    FileNotFoundError
        There is no such file.
    FormatError
        The file is empty, truncated, mislabelled or malformed; says where and what to do.
    MissingExtra
        The format needs an optional dependency.
    InvalidInput
        `format` or `columns` make no sense, or the format takes no `columns`.
    """
    asked = requested_names(columns)
    path = Path(path)
    data = read_bytes(path, "scan")
    return FORMATS[settled_format(path, data, format)].read(path, data, asked)


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
    """Write a scan so that `read_scan` gives the same values back, or leave the disk as it was.

    Parameters
    ----------
    path : path-like
        The file; one that exists is replaced only once the new one is complete.
    points : (n, 3) [m]
        float32 is stored as float32, anything else as float64 where the format allows. Pass
        ``scan.points.astype(scan.coordinate_dtype)`` to store what was read as it was.
    fields : mapping of str to (n,) or (n, k), optional
        Further columns.
    format : str, optional
        A key of `FORMATS`; by default the ending of the name decides.
    encoding : {"binary", "ascii", "compressed"}, optional
        The first that the format has, by default.
    height : int
        Rows of an organised cloud, for PCD.
    viewpoint : Pose, optional
        Pose of the sensor in the frame of the points, for PCD.

    Raises
    ------
    InvalidInput
        No points, or something that the format cannot hold without loss.
    FileNotFoundError
        The folder does not exist.
    """
    path = Path(path)
    name = format_of_name(path) if format is None else require_format(format)
    if name is None:
        raise InvalidInput(
            f"the ending of {path.name} stands for no format; pass format= as one of "
            f"{', '.join(FORMATS)}"
        )
    known = FORMATS[name]
    chosen = known.encodings[0] if encoding is None else encoding
    if chosen not in known.encodings:
        raise InvalidInput(
            f"encoding of {name} must be one of {', '.join(known.encodings)}, got {encoding!r}"
        )
    if not known.organised and (height != 1 or viewpoint is not None):
        raise InvalidInput(f"{name} keeps no height or viewpoint; write .pcd, or leave them out")
    scan = _scan_to_write(points, fields or {}, name, height, viewpoint)
    with atomic_file(path) as handle:
        known.write(path, handle, scan, chosen)


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
            "further columns go into fields"
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
