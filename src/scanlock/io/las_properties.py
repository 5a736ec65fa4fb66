"""Properties of a LAS file beside its points, kept in memory to write the file again.

`scanlock.io.formats.las` reads and writes them.
"""

from dataclasses import dataclass

Triple = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True, slots=True)
class LasRecord:
    """A variable length record, byte for byte."""

    user_id: str
    """Registered name of the program or body that defines the record."""

    record_id: int
    """Number of the kind of record."""

    description: bytes
    """Description, at most 32 bytes."""

    data: bytes
    """Content."""

    is_extended: bool = False
    """Whether the record lies behind the points (LAS 1.4)."""


@dataclass(frozen=True, kw_only=True, slots=True)
class ExtraDimension:
    """Description of an extra dimension (extra bytes) of a LAS file."""

    name: str
    """Name."""

    dtype: str
    """Type of the stored values, as NumPy writes it: ``"<u2"``, or ``"<f4"`` of each element."""

    elements: int = 1
    """Number of values per point."""

    description: str = ""
    """Description."""

    scales: tuple[float, ...] | None = None
    """Steps of the stored whole numbers; None without scaling."""

    offsets: tuple[float, ...] | None = None
    """Offsets of the stored whole numbers; None without scaling."""

    no_data: tuple[float, ...] | None = None
    """Stored values that mean "no data"; None without any."""


@dataclass(frozen=True, kw_only=True, slots=True)
class LasProperties:
    """Properties of a LAS file beside its points and its coordinate reference system."""

    version: str
    """Version: ``"1.0"`` to ``"1.5"``."""

    point_format: int
    """Number of the point format."""

    scales: Triple
    """Steps of the coordinates in the unit of the file."""

    offsets: Triple
    """Offsets of the coordinates in the unit of the file."""

    system_id: str = ""
    """System identifier: the sensor, or the operation that made the file."""

    software: str = ""
    """Software that wrote the file."""

    global_encoding: int = 0
    """Bits of the header: kind of GPS time, WKT and others."""

    file_source_id: int = 0
    """Number of the flight line or file."""

    project_id: bytes = bytes(16)
    """GUID of the project."""

    extra_dimensions: tuple[ExtraDimension, ...] = ()
    """Extra dimensions."""

    records: tuple[LasRecord, ...] = ()
    """Other variable length records, without those of the coordinate reference system."""
