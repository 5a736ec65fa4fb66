"""PCD, the format of the Point Cloud Library: ascii, binary and LZF-compressed."""

import struct
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from scanlock.errors import InvalidInput
from scanlock.geometry.rotations import quaternion_from_rotation
from scanlock.io.columns import Request, require_request_of_names, require_writable_names
from scanlock.io.errors import check_body_size, malformed
from scanlock.io.formats.column_storage import row_table, with_common_type
from scanlock.io.formats.pcd_header import PADDING, PcdHeader, parse_header
from scanlock.io.numeric_text import as_declared_type, parse_rows, table_lines, truncation_notes
from scanlock.io.scan_file import Field, ScanFile, scan_from_columns

_MAX_RATIO = 100
"""Maximum compression ratio of LZF, which packs at most 264 bytes into 3."""

_ENCODINGS = {"binary": "binary", "ascii": "ascii", "compressed": "binary_compressed"}


def read_pcd(path: Path, data: bytes, columns: Request) -> ScanFile:
    """Read a PCD file of any encoding; padding is skipped, and rows with NaN are kept."""
    require_request_of_names(path, "PCD", columns)
    header = parse_header(path, data)
    parts = {
        "ascii": _ascii_columns,
        "binary": _binary_columns,
        "binary_compressed": _compressed_columns,
    }[header.encoding](path, data, header)
    named = [
        (field.name, part)
        for field, part in zip(header.fields, parts, strict=True)
        if field.name != PADDING
    ]
    return scan_from_columns(
        path,
        [name for name, _ in named],
        [part for _, part in named],
        request=columns,
        format="pcd",
        encoding=header.encoding,
        notes=(*header.notes, *(truncation_notes(data) if header.encoding == "ascii" else ())),
        width=header.width,
        height=header.height,
        viewpoint=header.viewpoint,
    )


def write_pcd(path: Path, handle: BinaryIO, scan: ScanFile, encoding: str) -> None:
    """Write every field in its own type; booleans as U 1, and half floats as F 4."""
    require_writable_names(path, scan.fields)
    columns: dict[str, Field] = {
        axis: scan.points[:, k].astype(scan.coordinate_dtype) for k, axis in enumerate("xyz")
    }
    for name, values in scan.fields.items():
        columns[name] = _storable(path, name, values)
    handle.write(_header_text(scan, columns, encoding))
    if encoding == "ascii":
        flat = [part for values in columns.values() for part in values.reshape(len(scan), -1).T]
        handle.write(table_lines(flat, " "))
    elif encoding == "binary":
        handle.write(row_table(columns).tobytes())
    else:
        _write_compressed(path, handle, columns)


def _ascii_columns(path: Path, data: bytes, header: PcdHeader) -> list[Field]:
    width = sum(field.count for field in header.fields)
    table = parse_rows(path, data[header.offset :], first_line=header.lines + 1, width=width)
    rows = len(table[0]) if table else 0
    if rows != header.points:
        raise malformed(
            path,
            f"after line {header.lines}",
            expected=f"{header.points} rows, as given by POINTS",
            found=f"{rows}",
            remedy="the file is cut short or its header is wrong; write it again",
        )
    parts: list[Field] = []
    first = 0
    for field in header.fields:
        group = [
            as_declared_type(path, column, field.dtype, field.name, f"after line {header.lines}")
            for column in table[first : first + field.count]
        ]
        parts.append(group[0] if field.count == 1 else np.stack(group, axis=1))
        first += field.count
    return parts


def _binary_columns(path: Path, data: bytes, header: PcdHeader) -> list[Field]:
    check_body_size(path, data, header.offset, header.points * header.row_size)
    layout: list[Any] = [
        (f"f{k}", field.dtype, (field.count,) if field.count > 1 else ())
        for k, field in enumerate(header.fields)
    ]
    table = np.frombuffer(data, np.dtype(layout), header.points, header.offset)
    return [table[f"f{k}"] for k in range(len(header.fields))]


def _compressed_columns(path: Path, data: bytes, header: PcdHeader) -> list[Field]:
    from scanlock.kernels.io.lzf import lzf_decode

    expected = header.points * header.row_size
    start = header.offset + 8
    if len(data) < start:
        raise malformed(
            path,
            f"byte {header.offset}",
            expected="two 4-byte sizes",
            found=f"the end after {len(data) - header.offset} bytes",
            remedy="the file is cut short; copy it again",
        )
    packed_size, raw_size = struct.unpack_from("<II", data, header.offset)
    if raw_size != expected or raw_size > _MAX_RATIO * packed_size:
        raise malformed(
            path,
            f"byte {header.offset + 4}",
            expected=f"{expected} unpacked bytes for {header.points} points",
            found=f"{packed_size} packed bytes for {raw_size} unpacked ones",
            remedy="the file is damaged; write it again",
        )
    check_body_size(path, data, start, packed_size)
    raw, status = lzf_decode(np.frombuffer(data, np.uint8, packed_size, start), raw_size)
    if status != raw_size:
        raise malformed(
            path,
            f"byte {start + abs(status)}",
            expected=f"LZF data of {raw_size} bytes",
            found="an invalid reference" if status <= 0 else f"{status} bytes",
            remedy="the file is damaged; copy or write it again",
        )
    # Compressed files are stored field by field, not point by point.
    parts: list[Field] = []
    offset = 0
    for field in header.fields:
        part = np.frombuffer(raw.data, field.dtype, header.points * field.count, offset)
        parts.append(part if field.count == 1 else part.reshape(header.points, field.count))
        offset += part.nbytes
    return parts


def _write_compressed(path: Path, handle: BinaryIO, columns: dict[str, Field]) -> None:
    from scanlock.kernels.io.lzf import lzf_encode

    raw = b"".join(
        values.astype(values.dtype.newbyteorder("<")).tobytes() for values in columns.values()
    )
    packed = lzf_encode(np.frombuffer(raw, np.uint8))
    if max(len(raw), len(packed)) >= 2**32:
        raise InvalidInput(
            f"{path}: compressed PCD must be below 4 GiB, got {len(raw)} bytes; write binary PCD"
        )
    handle.write(struct.pack("<II", len(packed), len(raw)))
    handle.write(packed.tobytes())


def _storable(path: Path, name: str, values: Field) -> Field:
    values = with_common_type(values)
    if values.dtype.kind not in "fiu" or values.dtype.itemsize > 8 or values.size == 0:
        raise InvalidInput(
            f"{path}: PCD cannot hold field {name} of type {values.dtype} and shape "
            f"{values.shape}; convert it to numbers of at most 8 bytes"
        )
    return values


def _header_text(scan: ScanFile, columns: dict[str, Field], encoding: str) -> bytes:
    if scan.viewpoint is None:
        viewpoint = "0 0 0 1 0 0 0"
    else:
        quaternion = quaternion_from_rotation(scan.viewpoint.rotation)
        numbers = [*scan.viewpoint.translation.tolist(), *quaternion.tolist()]
        viewpoint = " ".join(map(repr, numbers))
    counts = [values.size // len(scan) for values in columns.values()]
    kinds = [values.dtype.kind.upper() for values in columns.values()]
    lines = (
        "# .PCD v0.7 - Point Cloud Data file format",
        "VERSION 0.7",
        f"FIELDS {' '.join(columns)}",
        f"SIZE {' '.join(str(values.dtype.itemsize) for values in columns.values())}",
        f"TYPE {' '.join(kinds)}",
        f"COUNT {' '.join(map(str, counts))}",
        f"WIDTH {scan.width}",
        f"HEIGHT {scan.height}",
        f"VIEWPOINT {viewpoint}",
        f"POINTS {len(scan)}",
        f"DATA {_ENCODINGS[encoding]}",
    )
    return ("\n".join(lines) + "\n").encode("ascii")
