"""Parts of the description of a scan file: facts, and separately guesses."""

import math
from dataclasses import asdict, dataclass
from typing import Any

from scanlock.io.description.guesses import TimeGuess


@dataclass(frozen=True, kw_only=True, slots=True)
class FieldSummary:
    """Summary of a column other than the coordinates."""

    name: str
    """Name in the file."""

    dtype: str
    """Type in the file."""

    values: int
    """Number of values per point."""

    minimum: float
    """Smallest finite value; NaN if there is none."""

    maximum: float
    """Largest finite value; NaN if there is none."""


@dataclass(frozen=True, kw_only=True, slots=True)
class SystemSummary:
    """Summary of a coordinate reference system."""

    name: str
    """Name; empty if the file has none."""

    epsg: int | None
    """EPSG code; None if the file states none."""

    vertical_epsg: int | None
    """EPSG code of the vertical part; None if the file states none."""

    horizontal_unit: str
    """Unit of x and y in the file."""

    vertical_unit: str
    """Unit of z in the file."""

    is_geographic: bool
    """Whether x and y are longitude and latitude."""


@dataclass(frozen=True, kw_only=True, slots=True)
class LasSummary:
    """Summary of the header of a LAS file."""

    version: str
    """Version of LAS."""

    point_format: int
    """Number of the point format."""

    scales: tuple[float, float, float]
    """Steps of x, y and z in the unit of the file."""

    offsets: tuple[float, float, float]
    """Offsets of x, y and z in the unit of the file."""

    system_id: str
    """Sensor, or operation that made the file."""

    software: str
    """Software that wrote the file."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Guesses:
    """Guesses from the values of a scan; any of them may be wrong."""

    sensor: str
    """Kind of sensor."""

    time: TimeGuess | None
    """Unit and clock of the column of times; None without such a column."""


@dataclass(frozen=True, kw_only=True, slots=True)
class ScanDescription:
    """Facts of a scan file, and guesses in a separate attribute."""

    path: str
    """Path of the file."""

    questions: tuple[str, ...]
    """Questions to settle before all else: whether the unit is another one than read."""

    format: str
    """Key of `scanlock.io.FORMATS`."""

    title: str
    """Name of the format for display."""

    encoding: str
    """Encoding within the format."""

    size: int
    """Size of the file [bytes]."""

    points: int
    """Number of rows."""

    width: int
    """Number of columns of an organised cloud, else of all rows."""

    height: int
    """Number of rows of an organised cloud, else 1."""

    coordinate_dtype: str
    """Type of the coordinates in the file."""

    fields: tuple[FieldSummary, ...]
    """Columns other than the coordinates."""

    not_finite: int
    """Number of rows with NaN or Inf coordinates."""

    zeros: int
    """Number of rows at (0, 0, 0), which sensors write for lost returns."""

    duplicates: int
    """Number of rows that repeat an earlier row exactly, without those at (0, 0, 0)."""

    minimum: tuple[float, float, float]
    """Smallest x, y and z [m] of the usable rows (finite, not zero)."""

    maximum: tuple[float, float, float]
    """Largest x, y and z [m] of the usable rows."""

    median_range: float
    """Median horizontal distance from the sensor [m]; NaN in map coordinates, and for degrees."""

    max_range: float
    """Largest horizontal distance from the sensor [m]; NaN in map coordinates, and for degrees."""

    spacing: float
    """Median distance between nearest neighbours of a sample [m]; NaN for a single point, and for
    degrees."""

    large_coordinates: bool
    """Whether the coordinates are far enough from zero to be map coordinates."""

    origin: tuple[float, float, float]
    """Offset that registration subtracts first [m]; zero unless `large_coordinates`."""

    station: str
    """Name of the station, for formats that name their scans; else empty."""

    file_from_station: tuple[tuple[float, ...], ...] | None
    """Pose of the station in the frame of the file, as the rows of a (4, 4) matrix; None if the
    file has no pose."""

    metres_per_unit: tuple[float, float, float]
    """Factors from the unit of the file to metres, applied on reading."""

    system: SystemSummary | None
    """Coordinate reference system; None if the file states none."""

    las: LasSummary | None
    """Header of a LAS file; None for other formats."""

    ring_field: str | None
    """Name of the column of beam numbers; None without one."""

    rings: int | None
    """Number of distinct beam numbers; None without such a column."""

    time_field: str | None
    """Name of the column of times; None without one."""

    guesses: Guesses
    """All that was guessed."""

    notes: tuple[str, ...]
    """Notes of the reader, and on unusual values."""

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON, with the guesses under ``guesses`` and None for NaN."""
        return _plain(asdict(self))


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
