"""Headerless float32 rows (.bin), the format of KITTI, nuScenes, Newer College and others."""

from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from scanlock.errors import InvalidInput
from scanlock.io.column_order import refuse_other_order
from scanlock.io.columns import Request, conventional_names
from scanlock.io.errors import malformed
from scanlock.io.formats.row_length import guess_row_length, names_of_columns
from scanlock.io.scan_file import ScanFile, scan_from_columns

_MIN_MAGNITUDE, _MAX_MAGNITUDE = 1e-12, 1e8
"""Plausible magnitudes of a coordinate [m], an intensity or a label other than zero."""

_MAX_IMPLAUSIBLE_RATIO = 0.05
"""Maximum ratio of implausible values; doubles or integers read as float32 exceed it."""

_ASCENDING = 1000
"""Number of consecutive values that never all ascend where three coordinates alternate."""

_MAX_ROUNDING = 1e-3
"""Maximum rounding of coordinates by float32 [m] that the writer accepts."""

_REMEDY = "pass columns= (number or names) if it is known, or copy the file again"


def read_bin(path: Path, data: bytes, columns: Request) -> ScanFile:
    """Read rows of little-endian float32.

    Without `columns`, the length and the names of a row are guessed from the values; see
    `scanlock.io.formats.row_length`.
    """
    if len(data) % 4:
        raise malformed(
            path,
            f"byte {len(data) - len(data) % 4}",
            expected="whole float32 values (4 bytes each)",
            found=f"{len(data) % 4} bytes left over",
            remedy="the file is cut short or has another format",
        )
    values = np.frombuffer(data, dtype="<f4")
    if columns is None:
        # A signalling NaN is kept like any other NaN, without a warning.
        with np.errstate(invalid="ignore"):
            _require_plausible(path, values)
            width, names, notes = _guessed(path, values)
    else:
        width = columns if isinstance(columns, int) else len(columns)
        names, notes = conventional_names(width), list[str]()
    if len(values) % width:
        raise malformed(
            path,
            f"byte {len(data) - len(data) % (4 * width)}",
            expected=f"whole rows of {width} float32 ({4 * width} bytes)",
            found=f"{len(data) % (4 * width)} bytes left over",
            remedy=f"the file is cut short, or has other columns: {_REMEDY}",
        )
    table = values.reshape(-1, width)
    if not isinstance(columns, tuple) and width > 3:
        notes.append(f"names of columns after the third assumed: {', '.join(names[3:])}")
    return scan_from_columns(
        path,
        names,
        list(table.T),
        request=_every_name(path, columns),
        named=False,
        format="bin",
        encoding="binary",
        notes=tuple(notes),
    )


def _guessed(path: Path, values: NDArray[np.float32]) -> tuple[int, tuple[str, ...], list[str]]:
    """Return the row length, the names of the columns and a note on the guess."""
    width, note = guess_row_length(path, values)
    table = values.reshape(-1, width)
    names = names_of_columns(path, table)
    refuse_other_order(path, list(table.T))
    return width, names, [note]


def _every_name(path: Path, columns: Request) -> Request:
    """Return the requested columns; raise `InvalidInput` for pairs, which hide the row length."""
    if isinstance(columns, tuple) and any("=" in name for name in columns):
        raise InvalidInput(
            f"{path}: columns of .bin must name every column of a row in order, got "
            f'{" ".join(columns)!r}; leave some out as in "_ x y z"'
        )
    return columns


def write_bin(path: Path, handle: BinaryIO, scan: ScanFile, encoding: str) -> None:
    """Write x, y, z and an optional intensity as little-endian float32.

    Raises
    ------
    InvalidInput
        Other fields, or coordinates that float32 rounds by more than 1 mm.
    """
    extra = [name for name in scan.fields if name != "intensity"]
    if extra:
        raise InvalidInput(
            f"{path}: fields of .bin must be intensity only, got {', '.join(extra)}; remove them, "
            "or write .pcd, .ply or .npz"
        )
    columns = [*scan.points.T, *scan.fields.values()]
    with np.errstate(over="ignore", invalid="ignore"):
        rows = np.stack(columns, axis=1).astype("<f4")
        rounding = np.abs(rows[:, :3] - scan.points)[np.isfinite(scan.points)].max(initial=0.0)
    if not rounding <= _MAX_ROUNDING:
        raise InvalidInput(
            f"{path}: float32 would round coordinates by up to {rounding:.2g} m; subtract an "
            "origin first, or write .pcd, .ply or .npy"
        )
    handle.write(rows.tobytes())


def _require_plausible(path: Path, values: NDArray[np.float32]) -> None:
    start = values[:_ASCENDING]
    if len(start) == _ASCENDING and (start[1:] >= start[:-1]).all():
        raise malformed(
            path,
            "data",
            expected="float32 coordinates",
            found=f"values that only ascend ({start[0]:g}, {start[1]:g}, ... {start[-1]:g})",
            remedy="this looks like a column of times or indices, not a scan",
        )
    sample = np.abs(values[:: max(1, len(values) // 8192)])
    used = sample[np.isfinite(sample) & (sample > 0)]
    odd = int(((used < _MIN_MAGNITUDE) | (used > _MAX_MAGNITUDE)).sum())
    if len(used) == 0 or odd > _MAX_IMPLAUSIBLE_RATIO * len(used):
        raise malformed(
            path,
            "data",
            expected="float32 coordinates",
            found=f"{odd} of {len(used)} sampled values outside {_MIN_MAGNITUDE:g} to "
            f"{_MAX_MAGNITUDE:g}",
            remedy="these are probably doubles, integers or another format; convert them to "
            "float32 rows first, or pass columns= to skip this check",
        )
