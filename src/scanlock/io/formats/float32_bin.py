"""Headerless float32 rows (.bin), the format of KITTI, nuScenes, Newer College and others."""

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
"""Row lengths that are guessed: xyz, KITTI's xyzi, nuScenes' xyzir."""

_SAMPLE_ROWS = 2048

_MIN_DISTANCE = 0.2
"""Distance of the distributions of two columns above which they are different quantities.

Real scans have 0.26 to 1.0 with the correct row length, and below 0.05 with a wrong one (0.15 for
300 rows).
"""

_MIN_MAGNITUDE, _MAX_MAGNITUDE = 1e-12, 1e8
"""Plausible magnitudes of a coordinate [m], an intensity or a label other than zero."""

_MAX_IMPLAUSIBLE_RATIO = 0.05
"""Maximum ratio of implausible values; doubles or integers read as float32 exceed it."""

_ASCENDING = 1000
"""Number of consecutive values that never all ascend where three coordinates alternate."""

_MAX_ROUNDING = 1e-3
"""Maximum rounding of coordinates by float32 [m] that the writer accepts."""

_REMEDY = "pass columns= (number or names) if it is known, or copy the file again"


def read_bin(path: Path, data: bytes, columns: tuple[str, ...] | int | None) -> ScanFile:
    """Read rows of little-endian float32.

    Without `columns`, the row length is that of 3, 4 and 5 whose columns differ most in
    distribution. With a wrong row length every column mixes all quantities, so that all columns
    have the same distribution. The test does not depend on the order of the rows.
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
        notes.append(f"names of columns after the third assumed: {', '.join(names[3:])}")
    table = values.reshape(-1, width)
    return scan_from_columns(
        path, names, list(table.T), format="bin", encoding="binary", notes=tuple(notes)
    )


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


def _guessed_width(path: Path, values: NDArray[np.float32]) -> tuple[int, str]:
    fitting = [width for width in _WIDTHS if len(values) % width == 0]
    likely = _likely_width(values)
    if likely is not None and likely not in fitting:
        raise malformed(
            path,
            f"byte {4 * (len(values) - len(values) % likely)}",
            expected=f"whole rows of {likely} float32, as the values suggest",
            found=f"{4 * (len(values) % likely)} bytes left over",
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
        return fitting[0], (
            f"{fitting[0]} float32 columns assumed: the only common number that fits the size"
        )
    if likely is not None:
        return likely, (
            f"{likely} float32 columns guessed from the values ({', '.join(map(str, fitting))} fit "
            "the size); columns= overrides"
        )
    # The only criterion left is that an intensity is never negative.
    width = 4 if 4 in fitting and not (3 in fitting and (values[3::4] < 0).any()) else fitting[0]
    others = ", ".join(str(other) for other in fitting if other != width)
    return width, (
        f"{width} float32 columns assumed: the size also fits {others}, and the values do not "
        "decide; columns= overrides"
    )


def _likely_width(values: NDArray[np.float32]) -> int | None:
    """Return the row length that the values indicate clearly; None if they do not."""
    distances = {
        width: _column_distance(values, width) for width in _WIDTHS if len(values) >= width
    }
    if not distances:
        return None
    best = max(distances, key=lambda width: distances[width])
    # With few rows, two samples of one distribution differ by chance (the factor is the 0.1 %
    # quantile of the two-sample test).
    rows = len(values) // best
    chance = 1.95 * math.sqrt(2.0 / -(-rows // _row_stride(rows)))
    runner_up = max((one for width, one in distances.items() if width != best), default=0.0)
    return best if distances[best] > max(_MIN_DISTANCE, chance, 2.0 * runner_up) else None


def _row_stride(rows: int) -> int:
    stride = max(1, rows // _SAMPLE_ROWS)
    # With a stride that has a common factor with a row length, the columns of wrong rows would
    # differ in distribution too.
    while math.gcd(stride, math.prod(_WIDTHS)) != 1:
        stride += 1
    return stride


def _column_distance(values: NDArray[np.float32], width: int) -> float:
    """Return the largest Kolmogorov-Smirnov distance between two columns, for a row length."""
    rows = len(values) // width
    table = values[: rows * width].reshape(rows, width)[:: _row_stride(rows)]
    table = np.sort(np.where(np.isfinite(table), table, 0.0), axis=0)
    distance = 0.0
    for a, b in itertools.combinations(table.T, 2):
        both = np.concatenate((a, b))
        steps = np.searchsorted(a, both, side="right") - np.searchsorted(b, both, side="right")
        distance = max(distance, float(np.abs(steps).max()) / len(a))
    return distance
