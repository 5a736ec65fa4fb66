"""PLY, the Stanford polygon format, whose vertices are the points of a scan."""

from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from scanlock.errors import InvalidInput
from scanlock.io.columns import Request, require_request_of_names, require_writable_names
from scanlock.io.errors import check_body_size, malformed
from scanlock.io.formats.column_storage import row_table, with_common_type
from scanlock.io.formats.foreign import refuse_packed_ply
from scanlock.io.formats.ply_header import PlyElement, PlyHeader, parse_header
from scanlock.io.numeric_text import as_declared_type, parse_rows, table_lines, truncation_notes
from scanlock.io.scan_file import Field, ScanFile, flat_fields, scan_from_columns

_EXACT_INTEGER = 2**53
_MAX_ROW_SIZE = 2**31
"""Size below which NumPy can represent a row [bytes]."""

_NAMES = {
    "i1": "char",
    "u1": "uchar",
    "i2": "short",
    "u2": "ushort",
    "i4": "int",
    "u4": "uint",
    "f4": "float",
    "f8": "double",
}
_REMEDY = "the file is cut short, or its header is wrong; copy or write it again"


def read_ply(path: Path, data: bytes, columns: Request) -> ScanFile:
    """Read the vertices of an ascii or binary PLY file with all scalar properties."""
    require_request_of_names(path, "PLY", columns)
    header = parse_header(path, data)
    read = _ascii_columns if header.encoding == "ascii" else _binary_columns
    vertex = next(element for element in header.elements if element.name == "vertex")
    names = [entry.name for entry in vertex.properties]
    refuse_packed_ply(path, names)
    return scan_from_columns(
        path,
        names,
        read(path, data, header),
        request=columns,
        format="ply",
        encoding=header.encoding,
        notes=truncation_notes(data) if header.encoding == "ascii" else (),
    )


def write_ply(path: Path, handle: BinaryIO, scan: ScanFile, encoding: str) -> None:
    """Write vertices with every field as a property, in its own type where PLY has it.

    A field of several values per point becomes several properties: ``name_0``, ``name_1``, ...

    Raises
    ------
    InvalidInput
        64-bit integers beyond 2^53, which no PLY type holds, or a field that is not numeric.
    """
    require_writable_names(path, scan.fields)
    columns: dict[str, Field] = {
        axis: scan.points[:, k].astype(scan.coordinate_dtype) for k, axis in enumerate("xyz")
    }
    for name, values in flat_fields(path, scan).items():
        columns[name] = _storable(path, name, values)
    lines = [
        "ply",
        f"format {'ascii' if encoding == 'ascii' else 'binary_little_endian'} 1.0",
        f"element vertex {len(scan)}",
        *(f"property {_NAMES[part.dtype.str[1:]]} {name}" for name, part in columns.items()),
        "end_header",
    ]
    handle.write(("\n".join(lines) + "\n").encode("ascii"))
    if encoding == "ascii":
        handle.write(table_lines(list(columns.values()), " "))
        return
    handle.write(row_table(columns).tobytes())


def _storable(path: Path, name: str, values: Field) -> Field:
    values = with_common_type(values)
    if values.dtype.kind in "iu" and values.dtype.itemsize == 8:
        if len(values) and max(abs(int(values.min())), abs(int(values.max()))) > _EXACT_INTEGER:
            raise InvalidInput(
                f"{path}: integers of PLY must be within 2^53, got larger ones in field {name}; "
                "subtract an offset, or write .pcd or .npz"
            )
        return values.astype(np.float64)
    if values.dtype.str[1:] not in _NAMES:
        raise InvalidInput(f"{path}: PLY cannot hold field {name} of type {values.dtype}")
    return values


def _ascii_columns(path: Path, data: bytes, header: PlyHeader) -> list[Field]:
    body = data[header.offset :]
    # Data lines end in a lone carriage return if those of the header do.
    lines = (body.replace(b"\r", b"\n") if b"\n" not in body else body).split(b"\n")
    filled = [k for k, line in enumerate(lines) if line.strip()]
    expected = sum(element.count for element in header.elements)
    if len(filled) != expected:
        raise malformed(
            path,
            f"after line {header.lines}",
            expected=f"{expected} lines of data",
            found=f"{len(filled)}",
            remedy=_REMEDY,
        )
    index = next(k for k, element in enumerate(header.elements) if element.name == "vertex")
    vertex = header.elements[index]
    before = sum(element.count for element in header.elements[:index])
    first, last = filled[before], filled[before + vertex.count - 1]
    at = 0
    for element in header.elements:
        if element.has_lists:
            _check_list_lines(path, lines, filled[at : at + element.count], element, header.lines)
        at += element.count
    table = parse_rows(
        path,
        b"\n".join(lines[first : last + 1]),
        first_line=header.lines + 1 + first,
        width=len(vertex.properties),
    )
    return [
        as_declared_type(path, column, entry.dtype, entry.name, f"after line {header.lines}")
        for column, entry in zip(table, vertex.properties, strict=True)
    ]


def _check_list_lines(
    path: Path, lines: list[bytes], numbers: list[int], element: PlyElement, header_lines: int
) -> None:
    """Raise `FormatError` for a line on which the lists are not as long as they announce."""
    for number in numbers:
        words = lines[number].split()
        at = 0
        for entry in element.properties:
            length = 1
            if entry.length_dtype is not None:
                length = int(words[at]) if at < len(words) and words[at].isdigit() else len(words)
                at += 1
            at += length
        if at != len(words):
            raise malformed(
                path,
                f"line {header_lines + number + 1}",
                expected=f"a row of element {element.name} with lists of the announced lengths",
                found=repr(lines[number].strip()[:40].decode("ascii", "backslashreplace")),
                remedy=_REMEDY,
            )


def _binary_columns(path: Path, data: bytes, header: PlyHeader) -> list[Field]:
    offset = header.offset
    columns: list[Field] = []
    for element in header.elements:
        if element.name == "vertex":
            dtype = element.row_dtype
            _require_bytes(path, data, offset, element.count * dtype.itemsize, "vertex")
            table = np.frombuffer(data, dtype, element.count, offset)
            columns = [table[f"f{k}"] for k in range(len(element.properties))]
        offset = _end_of_element(path, data, offset, element)
    check_body_size(path, data, offset, 0)
    return columns


def _end_of_element(path: Path, data: bytes, offset: int, element: PlyElement) -> int:
    if element.count == 0:
        return offset
    if not element.has_lists:
        size = element.count * element.row_dtype.itemsize
        _require_bytes(path, data, offset, size, element.name)
        return offset + size
    uniform = _uniform_row_size(data, offset, element)
    if uniform is not None:
        return offset + element.count * uniform
    for _ in range(element.count):
        offset = _end_of_row(path, data, offset, element)
    return offset


def _end_of_row(path: Path, data: bytes, offset: int, element: PlyElement) -> int:
    for entry in element.properties:
        length = 1
        if entry.length_dtype is not None:
            _require_bytes(path, data, offset, entry.length_dtype.itemsize, element.name)
            length = int(np.frombuffer(data, entry.length_dtype, 1, offset)[0])
            offset += entry.length_dtype.itemsize
        _require_bytes(path, data, offset, length * entry.dtype.itemsize, element.name)
        offset += length * entry.dtype.itemsize
    return offset


def _uniform_row_size(data: bytes, offset: int, element: PlyElement) -> int | None:
    """Return the size of a row [bytes] if the lists of all rows have equal lengths, else None."""
    layout: list[Any] = []
    size = 0
    for k, entry in enumerate(element.properties):
        length = 1
        if entry.length_dtype is not None:
            if len(data) - offset < size + entry.length_dtype.itemsize:
                return None
            length = int(np.frombuffer(data, entry.length_dtype, 1, offset + size)[0])
            layout.append((f"n{k}", entry.length_dtype))
            size += entry.length_dtype.itemsize
        if length < 0 or length * entry.dtype.itemsize > len(data):
            return None
        layout.append((f"f{k}", entry.dtype, (length,)))
        size += length * entry.dtype.itemsize
    if element.count * size > len(data) - offset or size >= _MAX_ROW_SIZE:
        return None
    table = np.frombuffer(data, np.dtype(layout), element.count, offset)
    for k, entry in enumerate(element.properties):
        if entry.length_dtype is not None and (table[f"n{k}"] != table[f"n{k}"][0]).any():
            return None
    return size


def _require_bytes(path: Path, data: bytes, offset: int, size: int, name: str) -> None:
    if not 0 <= size <= len(data) - offset:
        raise malformed(
            path,
            f"byte {len(data)}",
            expected=f"{size} bytes of element {name} from byte {offset} on",
            found=f"{len(data) - offset}",
            remedy=_REMEDY,
        )
