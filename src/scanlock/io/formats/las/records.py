"""Variable length records of LAS files, and the coordinate reference system that they define.

The LAS 1.4 specification (R15) defines the records, and OGC 19-008 (GeoTIFF 1.1) the keys.
"""

import struct
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from scanlock.io.crs.coordinate_system import CoordinateSystem, system_from_statements
from scanlock.io.crs.from_wkt import StatedSystem, system_of_wkt
from scanlock.io.errors import malformed
from scanlock.io.formats.las.geo_keys import directory_of_system, system_of_geo_keys
from scanlock.io.las_properties import LasRecord

_SIZE, _EXTENDED_SIZE = 54, 60
_MAX_DATA_SIZE = 2**16 - 1

WKT_BIT = 0b0001_0000
"""Bit of the global encoding: the coordinate reference system is given by WKT."""

_WKT, _KEYS, _DOUBLES, _TEXT = 2112, 34735, 34736, 34737
_SYSTEM_RECORDS = {
    *(("LASF_Projection", code) for code in (2111, _WKT, _KEYS, _DOUBLES, _TEXT)),
    ("liblas", _WKT),
}


def defines_system(record: LasRecord) -> bool:
    """Return whether a record is part of a coordinate reference system."""
    return (record.user_id, record.record_id) in _SYSTEM_RECORDS


def has_geo_keys(record: LasRecord) -> bool:
    """Return whether a record is a directory of GeoTIFF keys."""
    return (record.user_id, record.record_id) == ("LASF_Projection", _KEYS)


def has_wkt(record: LasRecord) -> bool:
    """Return whether a record is well-known text."""
    return (record.user_id, record.record_id) == ("LASF_Projection", _WKT)


def wkt_record(text: str) -> LasRecord:
    """Return the record of a coordinate reference system by well-known text."""
    data = text.encode() + b"\0"
    return LasRecord(
        user_id="LASF_Projection",
        record_id=_WKT,
        description=b"WKT",
        data=data,
        is_extended=len(data) > _MAX_DATA_SIZE,
    )


def key_records(crs: CoordinateSystem) -> tuple[LasRecord, ...]:
    """Return the records of a coordinate reference system by EPSG codes; none without a code."""
    data = directory_of_system(crs)
    if not data:
        return ()
    return (
        LasRecord(
            user_id="LASF_Projection", record_id=_KEYS, description=b"GeoTIFF keys", data=data
        ),
    )


def read_records(path: Path, data: bytes) -> list[LasRecord]:
    """Return the records of a LAS file, those behind the points last.

    Raises
    ------
    FormatError
        A record that does not end within the file.
    """
    offset, _, count = struct.unpack_from("<HII", data, 94)
    records: list[LasRecord] = []
    for _ in range(count):
        record, offset = _read_record(path, data, offset, is_extended=False)
        records.append(record)
    if data[25] >= 4:
        offset, count = struct.unpack_from("<QI", data, 235)
        for _ in range(count):
            record, offset = _read_record(path, data, offset, is_extended=True)
            records.append(record)
    return records


def _read_record(
    path: Path, data: bytes, offset: int, *, is_extended: bool
) -> tuple[LasRecord, int]:
    head = _EXTENDED_SIZE if is_extended else _SIZE
    size = len(data) - offset - head
    if size >= 0:
        user, code, needed, description = struct.unpack_from(
            "<2x16sHQ32s" if is_extended else "<2x16sHH32s", data, offset
        )
        if needed <= size:
            start = offset + head
            return LasRecord(
                user_id=_before_zero(user).decode("latin-1"),
                record_id=code,
                description=_before_zero(description),
                data=data[start : start + needed],
                is_extended=is_extended,
            ), start + needed
    raise malformed(
        path,
        f"byte {offset}",
        expected="a variable length record",
        found="the end of the file",
        remedy="the file is cut short or damaged; copy it again",
    )


def _before_zero(data: bytes) -> bytes:
    return data.split(b"\0")[0]


def system_of_records(
    records: Sequence[LasRecord], *, prefers_wkt: bool
) -> CoordinateSystem | None:
    """Return the coordinate reference system that the records define; None without one.

    Where GeoTIFF keys and WKT are both there, properties that the preferred one does not state
    are taken from the other, and a note reports different units.

    Parameters
    ----------
    records : sequence of LasRecord
    prefers_wkt : bool
        Whether the header of the file prefers WKT to GeoTIFF keys.
    """
    used = tuple(record for record in records if defines_system(record))
    if not used:
        return None
    notes: list[str] = []
    text = next((_text(record) for record in used if has_wkt(record)), "")
    found: dict[str, StatedSystem] = {}
    try:
        found = {"WKT": system_of_wkt(text)} if text.strip() else {}
    except ValueError as error:
        notes.append(f"the WKT of the coordinate reference system is unreadable: {error}")
    keys = next((record.data for record in used if has_geo_keys(record)), b"")
    doubles, strings = (
        next((record.data for record in used if record.record_id == code), b"")
        for code in (_DOUBLES, _TEXT)
    )
    stated = system_of_geo_keys(keys, doubles, strings)
    if stated is not None:
        found = (
            {**found, "GeoTIFF keys": stated} if prefers_wkt else {"GeoTIFF keys": stated, **found}
        )
    first, *others = found.values() or [StatedSystem()]
    for other in others:
        notes.extend(_differences(first, other, tuple(found)))
        first = _completed(first, other)
    system = system_from_statements(first)
    return replace(system, wkt=text, records=used, notes=(*notes, *system.notes))


def _text(record: LasRecord) -> str:
    return record.data.decode("utf-8", errors="replace").rstrip("\0")


def _completed(first: StatedSystem, other: StatedSystem) -> StatedSystem:
    if first.is_geographic != other.is_geographic:
        return first
    names = (
        "name",
        "epsg",
        "projected_epsg",
        "vertical_epsg",
        "angle_unit",
        "horizontal",
        "vertical",
    )
    missing = {name: getattr(other, name) for name in names if not getattr(first, name)}
    return replace(first, **missing)


def _differences(first: StatedSystem, other: StatedSystem, kinds: tuple[str, ...]) -> list[str]:
    pairs = [
        ("x and y", first.horizontal, other.horizontal),
        ("heights", first.vertical, other.vertical),
    ]
    return [
        f"the units of {axes} differ: {one.name} by {kinds[0]} (used), {two.name} by {kinds[1]}"
        for axes, one, two in pairs
        if one is not None and two is not None and one != two
    ]
