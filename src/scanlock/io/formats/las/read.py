"""Reader of LAS and LAZ files."""

import io
import struct
from pathlib import Path
from typing import Any

import numpy as np

from scanlock.arrays import Points
from scanlock.errors import FormatError, InvalidInput
from scanlock.io.crs.coordinate_system import unit_notes
from scanlock.io.errors import malformed
from scanlock.io.formats.las.backend import import_laspy, require_backend
from scanlock.io.formats.las.chunks import check_chunks
from scanlock.io.formats.las.dimensions import COORDINATES
from scanlock.io.formats.las.properties import properties_of
from scanlock.io.formats.las.records import WKT_BIT, read_records, system_of_records
from scanlock.io.scan_file import Field, ScanFile

_MIN_HEADER_SIZE = 227
_HEADER_SIZE_1_4 = 375
_COMPRESSED = 0x80
_REMEDY = "the file is cut short or damaged; copy it again"


def read_las(path: Path, data: bytes, columns: tuple[str, ...] | int | None) -> ScanFile:
    """Read a LAS or LAZ file; every point dimension other than the coordinates becomes a field.

    Coordinates in feet are converted to metres. Longitude and latitude stay degrees.

    Raises
    ------
    FormatError
        A damaged or truncated file.
    InvalidInput
        `columns` are given.
    MissingExtra
        laspy is not installed.
    """
    laspy = import_laspy(path)
    if columns is not None:
        raise InvalidInput(f"{path}: columns must not be given for LAS, which names its own")
    compressed = _check_header(path, data)
    require_backend(laspy, path, compressed=compressed)
    try:
        if compressed:
            check_chunks(laspy, path, data)
        # Damaged scales overflow to infinite coordinates, which later checks detect.
        with np.errstate(over="ignore", invalid="ignore"):
            header, points, fields = _decoded(laspy, data)
    except FormatError:
        raise
    except BaseException as error:
        if not (isinstance(error, _decoding_errors(laspy)) or _is_panic(error)):
            raise
        raise FormatError(
            f"{path}: expected {'LAZ' if compressed else 'LAS'} point records, found data that "
            f"laspy cannot read ({error}); {_REMEDY}"
        ) from error
    expected = int(header.point_count)
    if len(points) != expected or expected == 0:
        raise malformed(
            path,
            "point records",
            expected=f"{max(expected, 1)} points",
            found=f"{len(points)}",
            remedy=_REMEDY,
        )
    records = read_records(path, data)
    encoding = int(header.global_encoding.value)
    crs = system_of_records(records, prefers_wkt=bool(encoding & WKT_BIT))
    las, notes = properties_of(header, records)
    if crs is not None:
        points *= crs.metres_per_unit
        notes += unit_notes(crs)
    return ScanFile(
        points=points,
        fields=fields,
        format="las",
        encoding="compressed" if compressed else "binary",
        coordinate_dtype="int32, scaled",
        crs=crs,
        metres_per_unit=(1.0, 1.0, 1.0) if crs is None else crs.metres_per_unit,
        las=las,
        notes=tuple(notes),
    )


def _decoded(laspy: Any, data: bytes) -> tuple[Any, Points, dict[str, Field]]:
    las = laspy.read(io.BytesIO(data))
    points = np.ascontiguousarray(np.stack([las.x, las.y, las.z], axis=1), dtype=np.float64)
    names = [name for name in las.point_format.dimension_names if name not in COORDINATES]
    return las.header, points, {name: np.array(las[name]) for name in names}


def _check_header(path: Path, data: bytes) -> bool:
    """Return whether the points are compressed; raise unless the sizes in the header fit the file.

    laspy itself returns fewer points from a truncated file, and runs for minutes on a damaged
    count. Offsets are those of the LAS 1.4 specification.
    """
    if data[:4] != b"LASF" or len(data) < _MIN_HEADER_SIZE:
        raise malformed(
            path,
            "byte 0",
            expected=f"LASF and a header of at least {_MIN_HEADER_SIZE} bytes",
            found=f"{data[:4]!r} and {len(data)} bytes",
            remedy=_REMEDY,
        )
    header_size, start, records, kind, row_size, count = struct.unpack_from("<HIIBHI", data, 94)
    compressed = bool(kind & _COMPRESSED)
    _require_room(path, 94, "header", header_size, min(start, len(data)))
    _require_room(path, 96, "header", start, len(data))
    _require_room(path, 100, "variable length records", 54 * records, start - header_size)
    if data[25] >= 4 and header_size >= _HEADER_SIZE_1_4:
        more_start, more, count = struct.unpack_from("<QIQ", data, 235)
        room = len(data) - more_start
        _require_room(path, 243, "extended variable length records", 60 * more, max(room, 0))
    # Compression by more than a factor of a thousand is not known.
    needed = count * row_size // (1000 if compressed else 1)
    _require_room(path, 107, f"{count} points", needed, len(data) - start)
    if compressed:
        _check_chunk_table(path, data, start)
    return compressed


def _check_chunk_table(path: Path, data: bytes, start: int) -> None:
    """Raise `FormatError` unless LAZ data end in a table with at most one chunk per byte.

    The decompressor allocates memory for the chunks that the table announces, and aborts the
    process if a damaged number is too large.
    """
    _require_room(path, start, "offset of the chunk table", 8, len(data) - start)
    (offset,) = struct.unpack_from("<q", data, start)
    if offset == -1:  # written to a stream: the offset is at the end of the file
        (offset,) = struct.unpack_from("<q", data, len(data) - 8)
    if not start + 8 <= offset <= len(data) - 8:
        raise malformed(
            path,
            f"byte {start}",
            expected=f"the offset of a chunk table between {start + 8} and {len(data) - 8}",
            found=str(offset),
            remedy=_REMEDY,
        )
    _, chunks = struct.unpack_from("<II", data, offset)
    _require_room(path, offset + 4, f"{chunks} chunks", chunks, offset - start)


def _require_room(path: Path, offset: int, content: str, needed: int, room: int) -> None:
    if needed > room:
        raise malformed(
            path,
            f"byte {offset}",
            expected=f"at least {needed} bytes for the {content}",
            found=f"{room}",
            remedy=_REMEDY,
        )


def _is_panic(error: BaseException) -> bool:
    """Return whether an error is a Rust panic of the decompressor on damaged data.

    Such errors derive directly from `BaseException`, and their class cannot be imported.
    """
    return type(error).__name__ == "PanicException"


def _decoding_errors(laspy: Any) -> tuple[type[Exception], ...]:
    """Return the errors that laspy and its decompressor raise on damaged data (undocumented)."""
    return (
        laspy.errors.LaspyException,
        ArithmeticError,
        AttributeError,
        EOFError,
        LookupError,
        MemoryError,
        RuntimeError,
        TypeError,
        ValueError,
        struct.error,
    )
