"""Guesses about a scan for ``scanlock info``: sensor, unit of the times and of lengths.

All of them are heuristics, and are presented as guesses.
"""

from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Points, Vector
from scanlock.clouds.point_cloud import PointCloud
from scanlock.io.crs.coordinate_system import CoordinateSystem
from scanlock.io.crs.units import UNKNOWN
from scanlock.io.scan_file import Field, ScanFile

_TIME_NAMES = (
    "t",
    "time",
    "times",
    "timestamp",
    "timestamps",
    "time_stamp",
    "stamp",
    "gps_time",
    "gpstime",
    "time_offset",
    "offset_time",
    "point_time",
)
_RING_NAMES = ("ring", "channel", "beam", "laser_id", "laser_number", "line", "scan_line")
_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_SWEEP_DURATION = 0.1
"""Duration of a revolution of common lidars [s]."""

_UNIX_TIMES = (1e9, 4e9)
"""Range of times that count as Unix time [s]: years 2001 to 2096."""

_BEAMS = (4, 512)
"""Minimum and maximum number of beams of a lidar."""

_MIN_RING_SEPARATION = 0.15
"""Rings with median elevations closer than this [deg] are one ring, stored in two parts."""

_ELEVATION_BIN = 0.05
"""Width of the elevation histogram's bins [deg]; most are empty between beams."""

_WINDOW = 2048
"""Consecutive points during which the motion of the sensor is negligible."""

_DIRECTION_CELL = 2.0
"""Size of the direction cells [deg] with one surface each, as seen from the sensor."""

_MIN_POINTS = 500
"""Minimum number of points for a guess of the sensor."""

_MIN_CELLS = 50
"""Minimum number of direction cells for a guess of the viewpoint."""

_MIN_CELL_POINTS = 6
"""Minimum number of points of a cell, as for the Gaussians of common NDT implementations."""

_MAX_RADIUS, _MIN_RADIUS = 2000.0, 0.1
"""Median distances from the middle of a scan [m] beyond which its unit is unclear."""

_LARGE_RADIUS, _SPARSE = 100.0, 0.5
"""Median distance from the middle, and spacing [m], above which only terrain is in metres."""


@dataclass(frozen=True, kw_only=True, slots=True)
class TimeGuess:
    """Guess of the unit and the clock of a column of times."""

    unit: str
    """Unit: ``"s"``, ``"ms"``, ``"us"``, ``"ns"``, ``"fraction of the sweep"`` or ``"unknown"``."""

    span: float | None
    """Time between the first and the last point [s]; None if the unit is unknown."""

    clock: str
    """Clock: ``"Unix time"`` or ``"relative"``."""


def time_field(scan: ScanFile) -> str | None:
    """Return the name of the column of times; None if no column has such a name."""
    return _named(scan, _TIME_NAMES)


def ring_field(scan: ScanFile) -> str | None:
    """Return the name of the column of beam numbers; None if no column has such a name."""
    name = _named(scan, _RING_NAMES)
    return name if name is not None and len(np.unique(scan.fields[name])) <= _BEAMS[1] else None


def guess_time(name: str, values: Field) -> TimeGuess:
    """Guess the unit of a column of times.

    In this order: the unit in which the values are a Unix time, the unit at the end of the name
    (``time_ns``), or the unit that brings the span closest to 0.1 s, a common sweep, on a
    logarithmic scale.

    Parameters
    ----------
    name : str
        Name of the column.
    values : (n,)
    """
    finite = values[np.isfinite(values)] if values.dtype.kind == "f" else values
    if len(finite) == 0 or finite.min() == finite.max():
        return TimeGuess(unit="unknown", span=None, clock="relative")
    low, high = float(finite.min()), float(finite.max())
    # Subtract before converting: nanosecond counts lose digits in float64.
    span = float(finite.max() - finite.min())
    for unit, seconds in _UNITS.items():
        if _UNIX_TIMES[0] <= low * seconds <= high * seconds <= _UNIX_TIMES[1]:
            return TimeGuess(unit=unit, span=span * seconds, clock="Unix time")
    named = "s" if name.lower().startswith("gps") else name.lower().rpartition("_")[2]
    if named in _UNITS:
        return TimeGuess(unit=named, span=span * _UNITS[named], clock="relative")
    if values.dtype.kind == "f" and 0.0 <= low < 0.1 and 0.9 < high <= 1.0:
        return TimeGuess(unit="fraction of the sweep", span=None, clock="relative")
    differences = {
        unit: abs(np.log10(span * seconds / _SWEEP_DURATION))
        for unit, seconds in _UNITS.items()
        if values.dtype.kind == "f" or unit != "s"
    }
    unit = min(differences, key=lambda unit: differences[unit])
    return TimeGuess(unit=unit, span=span * _UNITS[unit], clock="relative")


def guess_sensor(points: Points, rings: int | None, rows: int) -> str:
    """Guess the kind of sensor of a scan.

    Parameters
    ----------
    points : (n, 3) [m]
        Finite points other than (0, 0, 0), in file order, recentred if in map coordinates.
    rings : int or None
        Number of distinct beam numbers, for files that have them.
    rows : int
        Number of rows of an organised cloud, else 1.

    Returns
    -------
    str
        A short description, or ``"unknown"``.
    """
    beams = rings if rings is not None else rows if _BEAMS[0] <= rows <= _BEAMS[1] else None
    if beams is None:
        beams = _beams_by_revolutions(points) or _beams_by_elevation(points)
    if beams is not None:
        sectors = np.unique(np.floor(np.degrees(np.arctan2(points[:, 1], points[:, 0])) / 5.0))
        if len(sectors) > 54:
            return f"spinning lidar, about {beams} beams"
        return f"lidar with about {beams} beams, {5 * len(sectors)} degrees wide"
    if len(points) < _MIN_POINTS:
        return "unknown"
    if _densest_ratio(points) < 0.3:
        return "airborne scan or map tile"
    multiple = _multiple_surface_ratio(points)
    if multiple is None or 0.45 <= multiple < 0.5:
        return "unknown"
    if multiple < 0.45:
        return "scanner at the origin, number of beams unknown"
    return "scanner away from the origin, or a map of several scans"


def unit_questions(
    crs: CoordinateSystem | None, cloud: PointCloud, spacing: float
) -> tuple[str, ...]:
    """Return questions on the unit of a scan, where it is unclear and the file does not state it.

    Parameters
    ----------
    crs : CoordinateSystem or None
    cloud : PointCloud
    spacing : float [m]
        Median distance between nearest neighbours.
    """
    if crs is not None and crs.is_geographic:
        return ()
    if crs is not None and crs.horizontal_unit != UNKNOWN:
        return ()
    radius = cloud.radius
    size = f"half of the points lie more than {radius:,.0f} units from their middle"
    if radius > _MAX_RADIUS:
        return (f"are these millimetres? {size}; --scale 0.001 reads millimetres",)
    if radius > _LARGE_RADIUS and _is_tall(cloud, spacing):
        return (
            f"are these centimetres or millimetres? {size}, too tall for terrain; --scale 0.01 "
            "reads centimetres, and --scale 0.001 millimetres",
        )
    if 0.0 < radius < _MIN_RADIUS:
        return (
            f"which unit is this? half of the points lie within {radius:.2g} units of their "
            "middle; --scale gives the unit in metres, for example 1000 for kilometres",
        )
    if crs is not None:
        return (
            "are these feet? the coordinate system has no unit; --scale 0.3048 reads feet, and "
            "--scale 0.30480061 US survey feet",
        )
    return ()


def _is_tall(cloud: PointCloud, spacing: float) -> bool:
    """Return whether a wide, sparse cloud is too tall for terrain: an object or a room."""
    low, high = np.percentile(cloud.points[:, 2], (1.0, 99.0))
    return spacing > _SPARSE and float(high - low) > 0.5 * cloud.radius


def _named(scan: ScanFile, names: tuple[str, ...]) -> str | None:
    for name, values in scan.fields.items():
        # CloudCompare prefixes the names of columns with "scalar_".
        bare = name.lower().removeprefix("scalar_")
        stem, _, last = bare.rpartition("_")
        if (bare in names or (last in _UNITS and stem in names)) and values.ndim == 1:
            return name
    return None


def _elevations(points: Points) -> Vector:
    return np.degrees(np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1])))


def _beams_by_revolutions(points: Points) -> int | None:
    """Count the rings of a cloud stored ring by ring (KITTI), by their median elevations."""
    azimuths = np.arctan2(points[:, 1], points[:, 0])
    steps = (np.diff(azimuths) + np.pi) % (2 * np.pi) - np.pi
    forward = float((steps > 0).mean()) if len(steps) else 0.5
    if max(forward, 1.0 - forward) < 0.95:
        return None
    revolutions = np.floor(np.abs(np.concatenate(([0.0], np.cumsum(steps)))) / (2 * np.pi))
    revolutions = revolutions.astype(np.int64)
    if not _BEAMS[0] <= revolutions.max() <= _BEAMS[1]:
        return None
    elevations = _elevations(points)
    medians = np.sort([np.median(elevations[revolutions == k]) for k in np.unique(revolutions)])
    return int((np.diff(medians) > _MIN_RING_SEPARATION).sum()) + 1


def _beams_by_elevation(points: Points) -> int | None:
    """Count distinct elevations, in the whole scan or else in windows of consecutive points."""
    far = points[np.hypot(points[:, 0], points[:, 1]) > 2.0]
    if len(far) < _MIN_POINTS:
        return None
    elevations = _elevations(far)
    edges = np.arange(elevations.min(), elevations.max() + 2 * _ELEVATION_BIN, _ELEVATION_BIN)
    counts = np.histogram(elevations, edges)[0]
    used = counts > max(3.0, 5e-4 * len(far))
    beams = int((np.diff(np.concatenate(([0], used.astype(np.int64)))) == 1).sum())
    if counts[used].sum() < 0.99 * len(far) or used.mean() > 0.2:
        beams = _beams_in_windows(elevations)
    return beams if _BEAMS[0] <= beams <= _BEAMS[1] else None


def _beams_in_windows(elevations: Vector) -> int:
    """Count distinct elevations per window, for scans blurred by motion; 0 if there are none."""
    found: list[int] = []
    for start in np.linspace(0, max(0, len(elevations) - _WINDOW), 9).astype(np.int64):
        window = np.sort(elevations[start : start + _WINDOW])
        groups = np.split(window, np.flatnonzero(np.diff(window) > 0.1) + 1)
        beams = [group for group in groups if len(group) >= 3]
        counts = np.array([len(group) for group in beams])
        widths = np.array([group[-1] - group[0] for group in beams])
        # Beams are narrow compared with their spacing. A wide group with outliers around it is
        # not a beam, however small a part of the range it covers.
        sharp = (
            counts.sum() > 0.9 * len(window)
            and widths.sum() < 0.25 * (window[-1] - window[0])
            and (counts * (widths > 0.5)).sum() < 0.1 * len(window)
        )
        found.append(len(beams) if sharp else 0)
    return int(np.median(found))


def _densest_ratio(points: Points) -> float:
    """Return the ratio of the points in the densest tenth of the occupied horizontal cells.

    Scans are densest near their sensor; map tiles are uniform.
    """
    low, high = np.percentile(points[:, :2], (2, 98), axis=0)
    cells = np.floor((points[:, :2] - low) / np.maximum(high - low, 1e-9) * 25).astype(np.int64)
    counts = np.sort(np.unique(cells, axis=0, return_counts=True)[1])[::-1]
    return float(counts[: max(1, len(counts) // 10)].sum() / counts.sum())


def _multiple_surface_ratio(points: Points) -> float | None:
    """Return the ratio of direction cells about the origin with widely separated surfaces.

    Seen from the sensor, a narrow cell holds one surface. None where too few cells have enough
    points.
    """
    ranges = np.linalg.norm(points, axis=1)
    far = ranges > 0.5
    ranges = ranges[far]
    if len(ranges) == 0:
        return None
    azimuths = np.degrees(np.arctan2(points[far, 1], points[far, 0]))
    cells = np.floor((azimuths + 180.0) / _DIRECTION_CELL) * 1000 + np.floor(
        (_elevations(points[far]) + 90.0) / _DIRECTION_CELL
    )
    order = np.lexsort((ranges, cells))
    cells, ranges = cells[order], ranges[order]
    starts = np.flatnonzero(np.concatenate(([True], np.diff(cells) > 0)))
    counts = np.diff(np.concatenate((starts, [len(cells)])))
    is_used = counts >= _MIN_CELL_POINTS
    starts, counts = starts[is_used], counts[is_used]
    if len(starts) < _MIN_CELLS:
        return None
    depth = ranges[starts + counts * 9 // 10] - ranges[starts + counts // 10]
    return float((depth > 0.2 * ranges[starts + counts // 2]).mean())
