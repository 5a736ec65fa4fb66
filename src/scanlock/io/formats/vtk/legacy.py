"""Legacy VTK files: the points and the point data of polygonal, unstructured and structured grids.

Written from the description of the format in the VTK user's guide. Binary numbers are big-endian.
Cells are skipped: vertices, lines and polygons are no points of their own.
"""

from pathlib import Path
from typing import BinaryIO

import numpy as np

from scanlock.errors import InvalidInput
from scanlock.io.columns import Request, require_request_of_names, require_writable_names
from scanlock.io.formats.column_storage import with_common_type
from scanlock.io.formats.vtk.legacy_sections import SectionReader
from scanlock.io.numeric_text import table_lines, truncation_notes
from scanlock.io.scan_file import Field, ScanFile, scan_from_columns

_TITLE = b"scanlock"
_TYPE_NAMES = {
    "u1": "unsigned_char",
    "i1": "char",
    "u2": "unsigned_short",
    "i2": "short",
    "u4": "unsigned_int",
    "i4": "int",
    "u8": "vtktypeuint64",
    "i8": "vtktypeint64",
    "f4": "float",
    "f8": "double",
}


def read_vtk(path: Path, data: bytes, columns: Request) -> ScanFile:
    """Read the points and point data of a legacy VTK file.

    Colours (``COLOR_SCALARS``) become bytes, as binary files have them. Cells and cell data are
    left out.

    Raises
    ------
    FormatError
        A file that is cut short or damaged, or a dataset without points.
    """
    require_request_of_names(path, "VTK", columns)
    reader = SectionReader(path, data)
    contents = reader.read()
    points = contents.points
    return scan_from_columns(
        path,
        ["x", "y", "z", *contents.fields],
        [*points.T, *contents.fields.values()],
        request=columns,
        format="vtk",
        encoding=reader.encoding,
        notes=(*contents.notes, *(truncation_notes(data) if reader.encoding == "ascii" else ())),
    )


def write_vtk(path: Path, handle: BinaryIO, scan: ScanFile, encoding: str) -> None:
    """Write polygonal data with one vertex for each point, and a field array for each field."""
    require_writable_names(path, scan.fields)
    is_text = encoding == "ascii"
    points = scan.points.astype(scan.coordinate_dtype)
    count = len(scan)
    head = [
        b"# vtk DataFile Version 3.0",
        _TITLE,
        b"ASCII" if is_text else b"BINARY",
        b"DATASET POLYDATA",
        f"POINTS {count} {_TYPE_NAMES[points.dtype.str[1:]]}".encode("ascii"),
    ]
    handle.write(b"\n".join(head) + b"\n")
    _write_values(handle, points, is_text)
    cells = np.stack([np.ones(count, np.int32), np.arange(count, dtype=np.int32)], axis=1)
    handle.write(f"VERTICES {count} {2 * count}\n".encode("ascii"))
    _write_values(handle, cells, is_text)
    if scan.fields:
        handle.write(f"POINT_DATA {count}\nFIELD FieldData {len(scan.fields)}\n".encode("ascii"))
    for name, values in scan.fields.items():
        stored = _storable(path, name, values)
        width = stored.size // count
        kind = _TYPE_NAMES[stored.dtype.str[1:]]
        handle.write(f"{_encoded(name)} {width} {count} {kind}\n".encode("ascii"))
        _write_values(handle, stored.reshape(count, width), is_text)


def _encoded(name: str) -> str:
    """Return a name with percent signs encoded, as VTK decodes them."""
    return name.replace("%", "%25").replace('"', "%22")


def _write_values(handle: BinaryIO, table: Field, is_text: bool) -> None:
    if is_text:
        handle.write(table_lines(list(table.T), " "))
    else:
        handle.write(table.astype(table.dtype.newbyteorder(">")).tobytes() + b"\n")


def _storable(path: Path, name: str, values: Field) -> Field:
    values = with_common_type(values)
    if values.dtype.str[1:] not in _TYPE_NAMES or values.size == 0:
        raise InvalidInput(f"{path}: VTK cannot hold field {name} of type {values.dtype}")
    return values
