"""Headerless rows of float32, as KITTI, nuScenes, Newer College and many others store scans."""

import itertools
import math
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from scanlock.errors import InvalidInput
from scanlock.io.columns import conventional_names
from scanlock.io.errors import malformed
from scanlock.io.scan_file import ScanFile, scan_from_columns

_WIDTHS = (3, 4, 5)
"""Columns that are told apart without help: xyz, KITTI's xyzi, nuScenes' xyzir."""

_SAMPLE_ROWS = 2048

_CLEAR_DIFFERENCE = 0.2
"""Largest distribution gap among columns above which they are plainly different quantities.

Real scans show 0.26 to 1.0 when cut into rows rightly, and below 0.05 when not (0.15 for 300
rows).
"""

_SMALLEST, _LARGEST = 1e-12, 1e8
"""Magnitudes a coordinate [m], an intensity or a label plausibly has; zero aside."""

_ODD_FRACTION = 0.05
"""Part of the values that may lie outside; doubles or integers read as float32 exceed it."""

_ASCENDING = 1000
"""So many values in a row never ascend all the way where three coordinates take turns."""

_LOST_DIGITS = 1e-3
"""Largest rounding [m] by float32 that the writer accepts."""

_REMEDY = "pass columns= (how many, or their names) if you know better, or copy the file again"


def read_bin(path: Path, data: bytes, columns: tuple[str, ...] | int | None) -> ScanFile:
    """Read rows of little-endian float32.

    Without `columns`, the row length is the one of 3, 4 and 5 whose columns differ most in
    distribution: cut into wrong rows, every column mixes all quantities and all look alike.
    The order of the rows does not matter to this test.
    """
    if len(data) % 4:
        raise malformed(
            path,
            f"byte {len(data) - len(data) % 4}",
            expected="whole float32 values (4 bytes each)",
            found=f"{len(data) % 4} bytes left over",
            remedy="the file is cut short or holds something else",
        )
    values = np.frombuffer(data, dtype="<f4")
    notes: list[str] = []
    if columns is None:
        _require_plausible(path, values)
        width, note = _guessed_width(path, values)
        notes.append(note)
    else:
        width = columns if isinstance(columns, int) else len(columns)
    if len(values) % width:
        raise malformed(
            path,
            f"byte {len(data) - len(data) % (4 * width)}",
            expected=f"whole rows of {width} float32 ({4 * width} bytes)",
            found=f"{len(data) % (4 * width)} bytes left over",
            remedy=f"the file is cut short, or has other columns: {_REMEDY}",
        )
    names = columns if isinstance(columns, tuple) else conventional_names(width)
    if not isinstance(columns, tuple) and width > 3:
        notes.append(f"columns past the third are named by convention: {', '.join(names[3:])}")
    table = values.reshape(-1, width)
    return scan_from_columns(
        path, names, list(table.T), format="bin", encoding="binary", notes=tuple(notes)
    )


def write_bin(path: Path, handle: BinaryIO, scan: ScanFile, encoding: str) -> None:
    """Write x y z, and intensity where there is one, as little-endian float32.

    Raises
    ------
    InvalidInput
        Other fields, or coordinates so large that float32 rounds them by more than 1 mm.
    """
    extra = [name for name in scan.fields if name != "intensity"]
    if extra:
        raise InvalidInput(
            f"{path}: fields {', '.join(extra)} have no place in .bin (x y z intensity); drop "
            "them, or write .pcd, .ply or .npz"
        )
    columns = [*scan.points.T, *scan.fields.values()]
    with np.errstate(over="ignore", invalid="ignore"):
        rows = np.stack(columns, axis=1).astype("<f4")
        lost = np.abs(rows[:, :3] - scan.points)[np.isfinite(scan.points)].max(initial=0.0)
    if not lost <= _LOST_DIGITS:
        raise InvalidInput(
            f"{path}: float32 would move points by up to {lost:.2g} m; subtract an origin first, "
            "or write .pcd, .ply or .npy"
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
            remedy="this looks like one column of times or numbers, not a scan",
        )
    sample = np.abs(values[:: max(1, len(values) // 8192)])
    used = sample[np.isfinite(sample) & (sample > 0)]
    odd = int(((used < _SMALLEST) | (used > _LARGEST)).sum())
    if len(used) == 0 or odd > _ODD_FRACTION * len(used):
        raise malformed(
            path,
            "data",
            expected="float32 coordinates",
            found=f"{odd} of {len(used)} sampled values outside {_SMALLEST:g} to {_LARGEST:g}",
            remedy="these are probably doubles, integers or another format; convert them to "
            "float32 rows first, or pass columns= to read them as they are",
        )


def _guessed_width(path: Path, values: NDArray[np.float32]) -> tuple[int, str]:
    fitting = [width for width in _WIDTHS if len(values) % width == 0]
    clear = _clear_width(values)
    if clear is not None and clear not in fitting:
        raise malformed(
            path,
            f"byte {4 * (len(values) - len(values) % clear)}",
            expected=f"whole rows of {clear} float32, which the values look like",
            found=f"{4 * (len(values) % clear)} bytes left over",
            remedy=f"the file is cut short; {_REMEDY}",
        )
    if not fitting:
        raise malformed(
            path,
            f"byte {4 * len(values)}",
            expected="whole rows of 3, 4 or 5 float32",
            found=f"the end after {len(values)} values",
            remedy=_REMEDY,
        )
    if len(fitting) == 1:
        return fitting[0], f"{fitting[0]} float32 columns: the only usual row length that fits"
    if clear is not None:
        return clear, (
            f"{clear} float32 columns guessed from the values ({', '.join(map(str, fitting))} fit "
            "the size); columns= overrides"
        )
    # Nothing tells them apart but this: an intensity is never negative.
    width = 4 if 4 in fitting and not (3 in fitting and (values[3::4] < 0).any()) else fitting[0]
    others = ", ".join(str(other) for other in fitting if other != width)
    return width, (
        f"{width} float32 columns by convention only: the size also fits {others} and the values "
        "do not tell; columns= overrides"
    )


def _clear_width(values: NDArray[np.float32]) -> int | None:
    """Return the row length that the values speak for; None if they do not."""
    gaps = {width: _column_gap(values, width) for width in _WIDTHS if len(values) >= width}
    if not gaps:
        return None
    best = max(gaps, key=lambda width: gaps[width])
    # With few rows, two samples of one distribution differ by chance (the factor is the 0.1 %
    # quantile of the two-sample test).
    rows = len(values) // best
    chance = 1.95 * math.sqrt(2.0 / -(-rows // _row_stride(rows)))
    rivals = max((gap for width, gap in gaps.items() if width != best), default=0.0)
    return best if gaps[best] > max(_CLEAR_DIFFERENCE, chance, 2.0 * rivals) else None


def _row_stride(rows: int) -> int:
    stride = max(1, rows // _SAMPLE_ROWS)
    # A stride that shares a factor with a row length would keep wrong rows in step with the
    # right ones and make their columns look different too.
    while math.gcd(stride, math.prod(_WIDTHS)) != 1:
        stride += 1
    return stride


def _column_gap(values: NDArray[np.float32], width: int) -> float:
    """Return the largest Kolmogorov-Smirnov distance between two columns of rows this long."""
    rows = len(values) // width
    table = values[: rows * width].reshape(rows, width)[:: _row_stride(rows)]
    table = np.sort(np.where(np.isfinite(table), table, 0.0), axis=0)
    gap = 0.0
    for a, b in itertools.combinations(table.T, 2):
        both = np.concatenate((a, b))
        steps = np.searchsorted(a, both, side="right") - np.searchsorted(b, both, side="right")
        gap = max(gap, float(np.abs(steps).max()) / len(a))
    return gap
