"""What a scan's numbers suggest about its sensor, its clock and the settings it needs.

Everything here is a guess and is labelled as one where it is shown.
"""

import bisect
from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Points, Vector
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
_SWEEP = 0.1
"""Seconds that most lidars take for a turn."""

_UNIX_TIMES = (1e9, 4e9)
"""Seconds since 1970 from 2001 to 2096."""

_BEAMS = (4, 512)
_RING_MERGE = 0.15
"""Rings whose median elevations are closer than this [deg] count as one, stored in two parts."""

_SHARP_BIN = 0.05
"""Width of the bins of elevation [deg] that single beams leave mostly empty."""

_WINDOW = 2048
"""Points in a row during which a moving scanner hardly turns."""

_CELL = 2.0
"""Size of the cells of direction [deg] in which one line of sight should meet one surface."""

_FEWEST_POINTS = 500
"""Points that it takes to judge by."""

_FEWEST_CELLS = 50
"""Lines of sight that it takes to judge by."""

_SUPPORT = 6
"""Points that a Gaussian needs at least, as in the usual NDT implementations."""

_ROUND_SIZES = tuple(float(f"{m}e{k}") for k in range(-2, 4) for m in ("1", "1.5", "2", "3", "5"))


@dataclass(frozen=True, kw_only=True, slots=True)
class TimeGuess:
    """What a column of times probably means."""

    unit: str
    """``"s"``, ``"ms"``, ``"us"``, ``"ns"``, ``"fraction of the sweep"`` or ``"unknown"``."""

    span: float | None
    """From the first to the last point [s]; None where the unit does not tell."""

    clock: str
    """``"Unix time"`` or ``"relative"``."""


@dataclass(frozen=True, kw_only=True, slots=True)
class SettingsGuess:
    """Where to start with registration; no more than that."""

    max_range: float
    """Horizontal range that holds 99 % of the points, rounded up [m]."""

    voxel_size: float
    """Smallest round cell size at which half the occupied cells hold 6 points [m]."""

    method: str
    """The method to try first."""


def time_field(scan: ScanFile) -> str | None:
    """Return the name of the column of times, if one is named like it."""
    return _named(scan, _TIME_NAMES)


def ring_field(scan: ScanFile) -> str | None:
    """Return the name of the column of beam numbers, if one is named like it."""
    name = _named(scan, _RING_NAMES)
    return name if name is not None and len(np.unique(scan.fields[name])) <= _BEAMS[1] else None


def guess_time(name: str, values: Field) -> TimeGuess:
    """Guess the unit of a column of times: by its size if it is Unix time, else by its span.

    A unit at the end of the name (``time_ns``) is believed. Otherwise the span is taken to be
    nearest to the tenth of a second of a common sweep, on a log scale.
    """
    finite = values[np.isfinite(values)] if values.dtype.kind == "f" else values
    if len(finite) == 0 or finite.min() == finite.max():
        return TimeGuess(unit="unknown", span=None, clock="relative")
    low, high = float(finite.min()), float(finite.max())
    # Differences of nanosecond counts lose digits if taken after the way through float64.
    span = float(finite.max() - finite.min())
    for unit, seconds in _UNITS.items():
        if _UNIX_TIMES[0] <= low * seconds <= high * seconds <= _UNIX_TIMES[1]:
            return TimeGuess(unit=unit, span=span * seconds, clock="Unix time")
    said = "s" if name.lower().startswith("gps") else name.lower().rpartition("_")[2]
    if said in _UNITS:
        return TimeGuess(unit=said, span=span * _UNITS[said], clock="relative")
    if values.dtype.kind == "f" and 0.0 <= low < 0.1 and 0.9 < high <= 1.0:
        return TimeGuess(unit="fraction of the sweep", span=None, clock="relative")
    gaps = {
        unit: abs(np.log10(span * seconds / _SWEEP))
        for unit, seconds in _UNITS.items()
        if values.dtype.kind == "f" or unit != "s"
    }
    unit = min(gaps, key=lambda unit: gaps[unit])
    return TimeGuess(unit=unit, span=span * _UNITS[unit], clock="relative")


def guess_sensor(points: Points, rings: int | None, rows: int) -> str:
    """Guess what took a scan.

    Parameters
    ----------
    points : (n, 3) [m]
        Finite points other than placeholders, in file order, map coordinates recentred.
    rings : int or None
        Distinct beam numbers, where the file has them.
    rows : int
        Height of an organised cloud, or 1.
    """
    beams = rings if rings is not None else rows if _BEAMS[0] <= rows <= _BEAMS[1] else None
    if beams is None:
        beams = _beams_by_turns(points) or _beams_by_elevation(points)
    if beams is not None:
        sectors = np.unique(np.floor(np.degrees(np.arctan2(points[:, 1], points[:, 0])) / 5.0))
        if len(sectors) > 54:
            return f"spinning lidar, about {beams} beams in sight"
        return f"lidar with about {beams} beams in sight, {5 * len(sectors)} degrees wide"
    if len(points) < _FEWEST_POINTS:
        return "not evident"
    if _densest_share(points) < 0.3:
        return "airborne or map tile"
    blocked = _blocked_share(points)
    if blocked is None or 0.45 <= blocked < 0.5:
        return "not evident"
    if blocked < 0.45:
        return "scanner at the origin, number of beams not evident"
    return "rotating scanner seen from elsewhere, or a map of several scans"


def guess_settings(points: Points) -> SettingsGuess:
    """Guess settings from what `guess_sensor` takes; the method is the default so far."""
    reach = float(np.percentile(np.hypot(points[:, 0], points[:, 1]), 99))
    return SettingsGuess(
        max_range=_rounded_up(reach),
        voxel_size=_voxel_size(points),
        method="sgc-ndt-d2d",
    )


def _named(scan: ScanFile, names: tuple[str, ...]) -> str | None:
    for name, values in scan.fields.items():
        # CloudCompare puts "scalar_" before the names of columns.
        bare = name.lower().removeprefix("scalar_")
        stem, _, last = bare.rpartition("_")
        if (bare in names or (last in _UNITS and stem in names)) and values.ndim == 1:
            return name
    return None


def _elevations(points: Points) -> Vector:
    return np.degrees(np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1])))


def _beams_by_turns(points: Points) -> int | None:
    """Count the rings of a cloud stored ring after ring (KITTI), by their median elevations."""
    azimuths = np.arctan2(points[:, 1], points[:, 0])
    steps = (np.diff(azimuths) + np.pi) % (2 * np.pi) - np.pi
    forward = float((steps > 0).mean()) if len(steps) else 0.5
    if max(forward, 1.0 - forward) < 0.95:
        return None
    turns = np.floor(np.abs(np.concatenate(([0.0], np.cumsum(steps)))) / (2 * np.pi))
    turns = turns.astype(np.int64)
    if not _BEAMS[0] <= turns.max() <= _BEAMS[1]:
        return None
    elevations = _elevations(points)
    medians = np.sort([np.median(elevations[turns == k]) for k in np.unique(turns)])
    return int((np.diff(medians) > _RING_MERGE).sum()) + 1


def _beams_by_elevation(points: Points) -> int | None:
    """Count distinct elevations, in the whole scan or else in short stretches of it."""
    far = points[np.hypot(points[:, 0], points[:, 1]) > 2.0]
    if len(far) < _FEWEST_POINTS:
        return None
    elevations = _elevations(far)
    edges = np.arange(elevations.min(), elevations.max() + 2 * _SHARP_BIN, _SHARP_BIN)
    counts = np.histogram(elevations, edges)[0]
    used = counts > max(3.0, 5e-4 * len(far))
    beams = int((np.diff(np.concatenate(([0], used.astype(np.int64)))) == 1).sum())
    if counts[used].sum() < 0.99 * len(far) or used.mean() > 0.2:
        beams = _beams_in_windows(elevations)
    return beams if _BEAMS[0] <= beams <= _BEAMS[1] else None


def _beams_in_windows(elevations: Vector) -> int:
    """Count elevations where motion between the first and the last point smears them; 0 if not."""
    found: list[int] = []
    for start in np.linspace(0, max(0, len(elevations) - _WINDOW), 9).astype(np.int64):
        window = np.sort(elevations[start : start + _WINDOW])
        groups = np.split(window, np.flatnonzero(np.diff(window) > 0.1) + 1)
        beams = [group for group in groups if len(group) >= 3]
        counts = np.array([len(group) for group in beams])
        widths = np.array([group[-1] - group[0] for group in beams])
        # A beam is narrow beside the space between beams; one wide group with stray points
        # around it is none, however little of the range it covers.
        sharp = (
            counts.sum() > 0.9 * len(window)
            and widths.sum() < 0.25 * (window[-1] - window[0])
            and (counts * (widths > 0.5)).sum() < 0.1 * len(window)
        )
        found.append(len(beams) if sharp else 0)
    return int(np.median(found))


def _densest_share(points: Points) -> float:
    """Return the share of the points in the densest tenth of the occupied map cells.

    Scans crowd around their sensor; tiles are filled evenly.
    """
    low, high = np.percentile(points[:, :2], (2, 98), axis=0)
    cells = np.floor((points[:, :2] - low) / np.maximum(high - low, 1e-9) * 25).astype(np.int64)
    counts = np.sort(np.unique(cells, axis=0, return_counts=True)[1])[::-1]
    return float(counts[: max(1, len(counts) // 10)].sum() / counts.sum())


def _blocked_share(points: Points) -> float | None:
    """Return the share of lines of sight from the origin that meet surfaces far apart.

    From where a scan was taken, a narrow cell of direction holds one surface. None where too few
    cells hold enough points to tell.
    """
    ranges = np.linalg.norm(points, axis=1)
    far = ranges > 0.5
    ranges = ranges[far]
    if len(ranges) == 0:
        return None
    azimuths = np.degrees(np.arctan2(points[far, 1], points[far, 0]))
    cells = np.floor((azimuths + 180.0) / _CELL) * 1000 + np.floor(
        (_elevations(points[far]) + 90.0) / _CELL
    )
    order = np.lexsort((ranges, cells))
    cells, ranges = cells[order], ranges[order]
    starts = np.flatnonzero(np.concatenate(([True], np.diff(cells) > 0)))
    counts = np.diff(np.concatenate((starts, [len(cells)])))
    starts, counts = starts[counts >= _SUPPORT], counts[counts >= _SUPPORT]
    if len(starts) < _FEWEST_CELLS:
        return None
    spread = ranges[starts + counts * 9 // 10] - ranges[starts + counts // 10]
    return float((spread > 0.2 * ranges[starts + counts // 2]).mean())


def _voxel_size(points: Points) -> float:
    place = bisect.bisect_left(_ROUND_SIZES, True, key=lambda size: _is_filled(points, size))
    return _ROUND_SIZES[min(place, len(_ROUND_SIZES) - 1)]


def _is_filled(points: Points, size: float) -> bool:
    """Tell whether half of the occupied cells of this size hold enough points."""
    cells = np.floor((points - points.min(axis=0)) / size).astype(np.int64)
    spans = cells.max(axis=0) + 1
    if float(np.prod(spans.astype(np.float64))) > 2.0**62:
        return False
    keys = (cells[:, 0] * spans[1] + cells[:, 1]) * spans[2] + cells[:, 2]
    counts = np.unique(keys, return_counts=True)[1]
    return bool((counts >= _SUPPORT).mean() >= 0.5)


def _rounded_up(value: float) -> float:
    return next((size for size in _ROUND_SIZES if size >= value), float(np.ceil(value)))
