"""Writer of LAS and LAZ files."""

import io
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from scanlock.arrays import Vector
from scanlock.errors import InvalidInput
from scanlock.io.formats.las.backend import import_laspy, require_backend
from scanlock.io.formats.las.dimensions import add_dimensions, fill_dimension
from scanlock.io.formats.las.grid import coordinate_grid, on_grid
from scanlock.io.formats.las.records import WKT_BIT, has_geo_keys, has_wkt, key_records, wkt_record
from scanlock.io.las_properties import LasProperties, LasRecord
from scanlock.io.scan_file import Field, ScanFile, flat_fields

_INDEXED = ".copc.laz"
"""Extension of COPC, whose points are ordered in an octree."""

_MAX_COORDINATE = 1e12
"""Coordinates above this are no lengths [m]."""

_COLOURED = {0: 2, 1: 3, 4: 5, 6: 7, 9: 10}
"""Point format with colours that extends each point format without."""

_DEFAULT = LasProperties(
    version="1.4",
    point_format=6,
    scales=(1e-4, 1e-4, 1e-4),
    offsets=(0.0, 0.0, 0.0),
    system_id="OTHER",
)
"""Properties of scans that were not read from a LAS file."""

_VERSIONS = {
    **dict.fromkeys((0, 1), ("1.1", "1.2", "1.3", "1.4")),
    **dict.fromkeys((2, 3), ("1.2", "1.3", "1.4")),
    **dict.fromkeys((4, 5), ("1.3", "1.4")),
}
"""Versions with each point format; the others are in 1.4 and 1.5."""


def write_las(path: Path, handle: BinaryIO, scan: ScanFile, encoding: str) -> None:
    """Write LAS, or LAZ for the extension .laz or the encoding "compressed".

    A scan that was read from LAS keeps version, point format, records and extra dimensions; others
    are written as LAS 1.4. Coordinates are written in the unit of the coordinate reference system.
    Scales and offsets of the file are kept as long as they hold the coordinates without loss;
    `coordinate_grid` chooses finer ones otherwise. Fields with the name of a LAS dimension are
    stored there, others as extra dimensions.

    Raises
    ------
    InvalidInput
        The extension .copc.laz, NaN or Inf in the points, or values that their LAS dimension
        cannot hold.
    MissingExtra
        laspy is not installed.
    """
    laspy = import_laspy(path)
    if path.name.lower().endswith(_INDEXED):
        plain = path.name[: -len(_INDEXED)] + ".laz"
        raise InvalidInput(
            f"{path}: COPC cannot be written; write {plain}, and index it with pdal translate"
        )
    compressed = encoding == "compressed" or path.suffix.lower() == ".laz"
    require_backend(laspy, path, compressed=compressed)
    if not (np.abs(scan.points) < _MAX_COORDINATE).all():
        raise InvalidInput(
            f"{path}: points of LAS must be finite and below 1e12 m, got NaN or Inf or larger "
            "values; remove such rows, or write .pcd or .ply"
        )
    kept = _DEFAULT if scan.las is None else scan.las
    fields = _columns(path, scan, kept)
    records = [*_system_records(scan), *kept.records]
    header = _new_header(laspy, kept, fields, records)
    units = np.ones(3) if scan.crs is None else np.array(scan.crs.metres_per_unit)
    coordinates = scan.points / units
    header.scales, header.offsets = coordinate_grid(
        coordinates, *_old_grid(kept, np.array(scan.metres_per_unit), units), units
    )
    add_dimensions(laspy, path, header, kept, fields)
    las = laspy.LasData(header)
    las.X, las.Y, las.Z = on_grid(coordinates, header.scales, header.offsets).T
    for name, values in fields.items():
        fill_dimension(path, las, name, values)
    las.evlrs = _laspy_records(laspy, records, is_extended=True) or None
    packed = io.BytesIO()
    las.write(packed, do_compress=compressed)
    handle.write(packed.getvalue())


def _columns(path: Path, scan: ScanFile, kept: LasProperties) -> dict[str, Field]:
    """Return the fields as columns; extra dimensions of two or three values stay whole."""
    whole = {one.name for one in kept.extra_dimensions if one.elements in (2, 3)}
    whole &= {name for name, values in scan.fields.items() if values.ndim == 2}
    return flat_fields(path, scan, whole)


def _old_grid(kept: LasProperties, old: Vector, units: Vector) -> tuple[Vector, Vector]:
    """Return the scales and offsets of the file in other units, as powers of ten if they differ."""
    scales, offsets = np.array(kept.scales), np.array(kept.offsets)
    if (old == units).all():
        return scales, offsets
    return 10.0 ** np.floor(np.log10(scales * old / units)), np.zeros(3)


def _system_records(scan: ScanFile) -> tuple[LasRecord, ...]:
    if scan.crs is None:
        return ()
    if scan.crs.records:
        return scan.crs.records
    return (wkt_record(scan.crs.wkt),) if scan.crs.wkt else key_records(scan.crs)


def _new_header(
    laspy: Any, kept: LasProperties, fields: dict[str, Field], records: list[LasRecord]
) -> Any:
    point_format = kept.point_format
    if {"red", "green", "blue"} <= set(fields):
        point_format = _COLOURED.get(point_format, point_format)
    known = _VERSIONS.get(point_format, ("1.4", "1.5"))
    version = kept.version if kept.version in known else known[0]
    states_wkt = any(map(has_wkt, records))
    is_wkt_only = states_wkt and not any(map(has_geo_keys, records))
    if any(record.is_extended for record in records) or is_wkt_only:
        version = max(version, "1.4")
    header = laspy.LasHeader(version=version, point_format=point_format)
    header.system_identifier = kept.system_id
    header.generating_software = "scanlock"
    header.file_source_id = kept.file_source_id
    header.uuid = type(header.uuid)(bytes_le=kept.project_id)
    bits = kept.global_encoding & ~WKT_BIT
    uses_wkt = is_wkt_only or (states_wkt and kept.global_encoding & WKT_BIT)
    header.global_encoding.value = bits | (WKT_BIT if uses_wkt else 0)
    header.vlrs = _laspy_records(laspy, records, is_extended=False)
    return header


def _laspy_records(laspy: Any, records: list[LasRecord], *, is_extended: bool) -> Any:
    return laspy.vlrs.vlrlist.VLRList(
        laspy.VLR(
            user_id=record.user_id,
            record_id=record.record_id,
            description=record.description,
            record_data=record.data,
        )
        for record in records
        if record.is_extended == is_extended
    )
