"""Description of a scan file for ``scanlock info``: facts, and separately guesses."""

import math
import os
from pathlib import Path
from typing import Any

import numpy as np

from scanlock.arrays import Points
from scanlock.clouds.point_cloud import PointCloud
from scanlock.geometry.pose import Pose
from scanlock.io.description.guesses import (
    guess_sensor,
    guess_time,
    ring_field,
    time_field,
    unit_questions,
)
from scanlock.io.description.scan_description import (
    FieldSummary,
    Guesses,
    LasSummary,
    ScanDescription,
    SystemSummary,
)
from scanlock.io.errors import malformed
from scanlock.io.formats.registry import FORMATS
from scanlock.io.formats.stations import split_station
from scanlock.io.scan_file import Field, ScanFile
from scanlock.io.scans import Columns, read_scan

_MAX_QUERIES = 5000
"""Number of points whose nearest neighbour is searched for the spacing, about."""

_MAX_LABELS = 32
"""Maximum number of distinct whole numbers in a column that may be labels."""


def describe_scan(
    path: str | os.PathLike[str],
    format: str | None = None,
    *,
    columns: Columns = None,
    scale: float | None = None,
) -> ScanDescription:
    """Describe a scan file.

    Parameters
    ----------
    path, format, columns, scale
        As for `read_scan`.

    Returns
    -------
    ScanDescription

    Raises
    ------
    FormatError
        Also where every row is NaN, Inf or (0, 0, 0).
    FileNotFoundError, MissingExtra, InvalidInput
        As for `read_scan`.
    """
    path = Path(path)
    scan = read_scan(path, format, columns=columns, scale=scale)
    usable, not_finite, zeros = _usable_points(path, scan)
    distinct = _distinct_rows(usable)
    cloud = PointCloud.from_array(usable)
    origin = cloud.origin
    is_geographic = scan.crs is not None and scan.crs.is_geographic
    ranges = np.hypot(usable[:, 0], usable[:, 1])
    if origin.any() or is_geographic:
        ranges = np.full(1, np.nan)
    spacing = math.nan if is_geographic else _spacing(distinct - origin)
    rings = ring_field(scan)
    times = time_field(scan)
    ring_count = None if rings is None else len(np.unique(scan.fields[rings]))
    return ScanDescription(
        path=str(path),
        questions=unit_questions(scan.crs, cloud, spacing),
        format=scan.format,
        title=FORMATS[scan.format].title,
        encoding=scan.encoding,
        size=split_station(path)[0].stat().st_size,
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
        spacing=spacing,
        large_coordinates=bool(origin.any()),
        origin=_triple(origin),
        station=scan.station,
        file_from_station=_rows(scan.file_from_station),
        metres_per_unit=scan.metres_per_unit,
        system=_system_summary(scan),
        las=_las_summary(scan),
        ring_field=rings,
        rings=ring_count,
        time_field=times,
        guesses=_guesses(scan, usable - origin, ring_count, times),
        notes=(*scan.notes, *_notes(scan, usable)),
    )


def _rows(pose: Pose | None) -> tuple[tuple[float, ...], ...] | None:
    return None if pose is None else tuple(tuple(row) for row in pose.matrix.tolist())


def _usable_points(path: Path, scan: ScanFile) -> tuple[Points, int, int]:
    """Return the points that are finite and not zero, and the numbers of the other two kinds."""
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
            remedy="check the program that wrote the file",
        )
    return usable, not_finite, zeros


def _guesses(scan: ScanFile, local: Points, ring_count: int | None, times: str | None) -> Guesses:
    is_geographic = scan.crs is not None and scan.crs.is_geographic
    return Guesses(
        sensor="unknown" if is_geographic else guess_sensor(local, ring_count, scan.height),
        time=None if times is None else guess_time(times, scan.fields[times]),
    )


def _system_summary(scan: ScanFile) -> SystemSummary | None:
    if scan.crs is None:
        return None
    return SystemSummary(
        name=scan.crs.name,
        epsg=scan.crs.epsg,
        vertical_epsg=scan.crs.vertical_epsg,
        horizontal_unit=scan.crs.horizontal_unit,
        vertical_unit=scan.crs.vertical_unit,
        is_geographic=scan.crs.is_geographic,
    )


def _las_summary(scan: ScanFile) -> LasSummary | None:
    if scan.las is None:
        return None
    return LasSummary(
        version=scan.las.version,
        point_format=scan.las.point_format,
        scales=scan.las.scales,
        offsets=scan.las.offsets,
        system_id=scan.las.system_id,
        software=scan.las.software,
    )


def _distinct_rows(points: Points) -> Points:
    """Return the points without exact duplicates, in another order."""
    # Adding zero turns -0 into +0, so that equal numbers have equal bits.
    bits = (points + 0.0).view(np.uint64)
    # Sorting one hash per row is much faster than sorting rows. Rows with the same hash by
    # chance (1 in 2^64) still differ in their bits.
    hashes = bits[:, 0] * np.uint64(0x9E3779B97F4A7C15)
    for axis in (1, 2):
        hashes = (hashes ^ (hashes >> np.uint64(29)) ^ bits[:, axis]) * np.uint64(
            0xBF58476D1CE4E5B9
        )
    order = np.argsort(hashes, kind="stable")
    ordered = bits[order]
    repeated = np.concatenate(([False], (ordered[1:] == ordered[:-1]).all(axis=1)))
    return points[order[~repeated]]


def _spacing(points: Points) -> float:
    from scipy.spatial import KDTree

    if len(points) < 2:
        return math.nan
    tree = KDTree(points, balanced_tree=False, compact_nodes=False)
    sample = points[:: max(1, len(points) // _MAX_QUERIES)]
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


def _notes(scan: ScanFile, usable: Points) -> list[str]:
    notes: list[str] = []
    if scan.coordinate_dtype == "float32":
        step = float(np.spacing(np.abs(usable).max().astype(np.float32)))
        if step > 1e-3:
            notes.append(f"float32 rounds these coordinates to multiples of {step:.2g} m")
    intensity = scan.fields.get("intensity")
    if scan.format == "bin" and intensity is not None:
        values = np.unique(intensity)
        if len(values) <= _MAX_LABELS and (values == np.round(values)).all():
            notes.append(
                f"the fourth column has {len(values)} distinct whole numbers: labels rather than "
                "intensities?"
            )
    return notes


def _triple(values: Points) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z
