"""What is in a scan file: the facts, and the guesses kept apart from them."""

import math
import os
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from scanlock.arrays import Points
from scanlock.clouds.point_cloud import PointCloud
from scanlock.io.errors import malformed
from scanlock.io.formats.registry import FORMATS
from scanlock.io.scan_file import Field, ScanFile
from scanlock.io.scan_guesses import (
    SettingsGuess,
    TimeGuess,
    guess_sensor,
    guess_settings,
    guess_time,
    ring_field,
    time_field,
)
from scanlock.io.scans import Columns, read_scan

_QUERIES = 5000
"""Points whose nearest neighbour is looked up."""

_FEW_VALUES = 32


@dataclass(frozen=True, kw_only=True, slots=True)
class FieldSummary:
    """One column besides the coordinates."""

    name: str
    """Name in the file."""

    dtype: str
    """Type in the file."""

    values: int
    """Values a point."""

    minimum: float
    """Smallest finite value; NaN without one."""

    maximum: float
    """Largest finite value; NaN without one."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Guesses:
    """What the numbers suggest; every one of these can be wrong."""

    sensor: str
    """What took the scan."""

    time: TimeGuess | None
    """What the column of times means; None without one."""

    settings: SettingsGuess
    """Where to start with registration."""


@dataclass(frozen=True, kw_only=True, slots=True)
class ScanDescription:
    """The facts of a scan file, and guesses apart from them."""

    path: str
    """The file."""

    format: str
    """Key of `scanlock.io.FORMATS`."""

    title: str
    """What people call the format."""

    encoding: str
    """How the format stored it."""

    size: int
    """Size of the file [bytes]."""

    points: int
    """Rows."""

    width: int
    """Columns of an organised cloud, or all rows."""

    height: int
    """Rows of an organised cloud, or 1."""

    coordinate_dtype: str
    """Type of the coordinates in the file."""

    fields: tuple[FieldSummary, ...]
    """The other columns."""

    not_finite: int
    """Rows with NaN or Inf among the coordinates."""

    zeros: int
    """Rows at (0, 0, 0), which sensors write where nothing came back."""

    duplicates: int
    """Rows that repeat an earlier one exactly, zeros not counted."""

    minimum: tuple[float, float, float]
    """Least x, y, z [m] of the usable rows (finite, not zero)."""

    maximum: tuple[float, float, float]
    """Largest x, y, z [m] of the usable rows."""

    median_range: float
    """Median horizontal distance from the origin of the file's frame [m]."""

    max_range: float
    """Largest horizontal distance from the origin of the file's frame [m]."""

    spacing: float
    """Median distance to the nearest other point, of a sample [m]; NaN for a single point."""

    large_coordinates: bool
    """Whether the coordinates are so far from zero that they must be map coordinates."""

    origin: tuple[float, float, float]
    """What registration subtracts first [m]; zero unless `large_coordinates`."""

    ring_field: str | None
    """Column of beam numbers, by its name."""

    rings: int | None
    """Distinct beam numbers."""

    time_field: str | None
    """Column of times, by its name."""

    guesses: Guesses
    """Everything that was inferred rather than counted."""

    notes: tuple[str, ...]
    """Remarks of the reader, and oddities."""

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON; what is guessed stands under ``guesses``, NaN is None."""
        return _plain(asdict(self))


def describe_scan(
    path: str | os.PathLike[str], format: str | None = None, *, columns: Columns = None
) -> ScanDescription:
    """Read a scan file and return what is in it; arguments and errors as in `read_scan`.

    Raises
    ------
    FormatError
        Also where no row is both finite and other than zero.
    """
    path = Path(path)
    scan = read_scan(path, format, columns=columns)
    usable, not_finite, zeros = _usable_points(path, scan)
    distinct = _distinct_rows(usable)
    origin = PointCloud.from_array(usable).origin
    ranges = np.hypot(usable[:, 0], usable[:, 1])
    rings = ring_field(scan)
    times = time_field(scan)
    ring_count = None if rings is None else len(np.unique(scan.fields[rings]))
    return ScanDescription(
        path=str(path),
        format=scan.format,
        title=FORMATS[scan.format].title,
        encoding=scan.encoding,
        size=path.stat().st_size,
        points=len(scan),
        width=scan.width,
        height=scan.height,
        coordinate_dtype=scan.coordinate_dtype,
        fields=tuple(_field_summary(name, values) for name, values in scan.fields.items()),
        not_finite=not_finite,
        zeros=zeros,
        duplicates=len(usable) - len(distinct),
        minimum=_triple(usable.min(axis=0)),
        maximum=_triple(usable.max(axis=0)),
        median_range=float(np.median(ranges)),
        max_range=float(ranges.max()),
        spacing=_spacing(distinct - origin),
        large_coordinates=bool(origin.any()),
        origin=_triple(origin),
        ring_field=rings,
        rings=ring_count,
        time_field=times,
        guesses=_guesses(scan, usable - origin, ring_count, times),
        notes=(*scan.notes, *_remarks(scan, usable)),
    )


def _usable_points(path: Path, scan: ScanFile) -> tuple[Points, int, int]:
    """Return the points that are finite and not zero, and how many are not finite or zero."""
    finite = np.isfinite(scan.points).all(axis=1)
    zero = (scan.points == 0.0).all(axis=1)
    usable = scan.points[finite & ~zero]
    not_finite, zeros = int((~finite).sum()), int(zero.sum())
    if len(usable) == 0:
        raise malformed(
            path,
            "data",
            expected="at least one point that is finite and not (0, 0, 0)",
            found=f"{not_finite} rows with NaN or Inf and {zeros} of zeros",
            remedy="check the program that wrote it",
        )
    return usable, not_finite, zeros


def _guesses(scan: ScanFile, local: Points, ring_count: int | None, times: str | None) -> Guesses:
    sensor = guess_sensor(local, ring_count, scan.height)
    return Guesses(
        sensor=sensor,
        time=None if times is None else guess_time(times, scan.fields[times]),
        settings=guess_settings(local),
    )


def _distinct_rows(points: Points) -> Points:
    """Return the points with exact repetitions dropped, in another order."""
    # Adding zero turns -0 into +0, so that equal numbers have equal bits.
    bits = (points + 0.0).view(np.uint64)
    # Sorting one mixed number a row is much faster than sorting rows. Rows that share it by
    # chance (1 in 2^64) are still told apart by their bits.
    mixed = bits[:, 0] * np.uint64(0x9E3779B97F4A7C15)
    for axis in (1, 2):
        mixed = (mixed ^ (mixed >> np.uint64(29)) ^ bits[:, axis]) * np.uint64(0xBF58476D1CE4E5B9)
    order = np.argsort(mixed, kind="stable")
    ordered = bits[order]
    repeated = np.concatenate(([False], (ordered[1:] == ordered[:-1]).all(axis=1)))
    return points[order[~repeated]]


def _spacing(points: Points) -> float:
    from scipy.spatial import KDTree

    if len(points) < 2:
        return math.nan
    tree = KDTree(points, balanced_tree=False, compact_nodes=False)
    sample = points[:: max(1, len(points) // _QUERIES)]
    distances: Any = tree.query(sample, k=2)[0]
    return float(np.median(distances[:, 1]))


def _field_summary(name: str, values: Field) -> FieldSummary:
    finite = values[np.isfinite(values)] if values.dtype.kind == "f" else values
    numeric = values.dtype.kind in "biuf" and finite.size > 0
    return FieldSummary(
        name=name,
        dtype=values.dtype.name,
        values=1 if values.ndim == 1 else values.shape[1],
        minimum=float(finite.min()) if numeric else math.nan,
        maximum=float(finite.max()) if numeric else math.nan,
    )


def _remarks(scan: ScanFile, usable: Points) -> list[str]:
    remarks: list[str] = []
    if scan.coordinate_dtype == "float32":
        step = float(np.spacing(np.abs(usable).max().astype(np.float32)))
        if step > 1e-3:
            remarks.append(f"float32 keeps these coordinates to {step:.2g} m only")
    intensity = scan.fields.get("intensity")
    if scan.format == "bin" and intensity is not None:
        values = np.unique(intensity)
        if len(values) <= _FEW_VALUES and (values == np.round(values)).all():
            remarks.append(
                f"the fourth column holds {len(values)} whole numbers: labels rather than "
                "intensities?"
            )
    return remarks


def _triple(values: Points) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
