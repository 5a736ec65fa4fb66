"""LAS and LAZ, the formats of surveying, through laspy (the optional extra ``las``)."""

import importlib
import io
import math
import struct
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from scanlock.arrays import Points
from scanlock.errors import FormatError, InvalidInput, MissingExtra
from scanlock.io.errors import malformed
from scanlock.io.formats.laz_chunks import check_chunks
from scanlock.io.scan_file import Field, ScanFile, flat_fields

_MIN_STEP = 1e-4
"""Resolution of written coordinates [m], unless the extent requires a coarser one."""

_MIN_HEADER_SIZE = 227
_HEADER_SIZE_1_4 = 375
_COMPRESSED = 0x80
_MAX_NAME_SIZE = 32
_COORDINATES = frozenset({"X", "Y", "Z", "x", "y", "z"})
_REMEDY = "the file is cut short or damaged; copy it again"


def read_las(path: Path, data: bytes, columns: tuple[str, ...] | int | None) -> ScanFile:
    """Read a LAS or LAZ file; every point dimension other than the coordinates becomes a field.

    Raises
    ------
    FormatError
        A damaged or truncated file.
    InvalidInput
        `columns` are given.
    MissingExtra
        laspy is not installed.
    """
    laspy = _laspy(path)
    if columns is not None:
        raise InvalidInput(f"{path}: columns must not be given for LAS, which names its own")
    compressed = _check_header(path, data)
    _require_backend(laspy, path, compressed=compressed)
    try:
        if compressed:
            check_chunks(laspy, path, data)
        # Damaged scales overflow to infinite coordinates, which later checks detect.
        with np.errstate(over="ignore", invalid="ignore"):
            expected, points, fields = _decoded(laspy, data)
    except FormatError:
        raise
    except BaseException as error:
        if not (isinstance(error, _decoding_errors(laspy)) or _is_panic(error)):
            raise
        raise FormatError(
            f"{path}: expected {'LAZ' if compressed else 'LAS'} point records, found data that "
            f"laspy cannot read ({error}); {_REMEDY}"
        ) from error
    if len(points) != expected or expected == 0:
        raise malformed(
            path,
            "point records",
            expected=f"{max(expected, 1)} points",
            found=f"{len(points)}",
            remedy=_REMEDY,
        )
    return ScanFile(
        points=points,
        fields=fields,
        format="las",
        encoding="compressed" if compressed else "binary",
        coordinate_dtype="int32, scaled",
    )


def _decoded(laspy: Any, data: bytes) -> tuple[int, Points, dict[str, Field]]:
    las = laspy.read(io.BytesIO(data))
    points = np.ascontiguousarray(np.stack([las.x, las.y, las.z], axis=1), dtype=np.float64)
    names = [name for name in las.point_format.dimension_names if name not in _COORDINATES]
    return int(las.header.point_count), points, {name: np.array(las[name]) for name in names}


def write_las(path: Path, handle: BinaryIO, scan: ScanFile, encoding: str) -> None:
    """Write LAS 1.4, or LAZ for the extension .laz or the encoding "compressed".

    Coordinates are stored with a resolution of 0.1 mm, or coarser for extents above 100 km.
    Fields with the name of a LAS dimension are stored there, others as extra dimensions.

    Raises
    ------
    InvalidInput
        NaN or Inf in the points, or values that their LAS dimension cannot hold.
    MissingExtra
        laspy is not installed.
    """
    laspy = _laspy(path)
    compressed = encoding == "compressed" or path.suffix.lower() == ".laz"
    _require_backend(laspy, path, compressed=compressed)
    if not np.isfinite(scan.points).all():
        raise InvalidInput(
            f"{path}: points of LAS must be finite, got NaN or Inf; remove such rows, or write "
            ".pcd or .ply"
        )
    fields = flat_fields(path, scan)
    has_colours = {"red", "green", "blue"} <= set(fields)
    header = laspy.LasHeader(version="1.4", point_format=7 if has_colours else 6)
    low = scan.points.min(axis=0)
    needed = float((scan.points.max(axis=0) - low).max()) / 2**30
    step = max(_MIN_STEP, 10.0 ** math.ceil(math.log10(needed)) if needed > 0 else 0.0)
    header.offsets = np.floor(low)
    header.scales = np.full(3, step)
    known = set(header.point_format.dimension_names) - _COORDINATES
    for name, values in fields.items():
        if name not in known:
            _require_extra_dimension(path, name, values)
            kind = np.uint8 if values.dtype.kind == "b" else values.dtype.newbyteorder("=")
            header.add_extra_dim(laspy.ExtraBytesParams(name=name, type=kind))
    las = laspy.LasData(header)
    las.x, las.y, las.z = scan.points.T
    for name, values in fields.items():
        _fill_dimension(path, las, name, values)
    packed = io.BytesIO()
    las.write(packed, do_compress=compressed)
    handle.write(packed.getvalue())


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


def _fill_dimension(path: Path, las: Any, name: str, values: Field) -> None:
    try:
        las[name] = values
        is_equal = np.array_equal(np.array(las[name]), values, equal_nan=values.dtype.kind == "f")
    except (OverflowError, ValueError, TypeError):
        is_equal = False
    if not is_equal:
        raise InvalidInput(
            f"{path}: the LAS dimension {name} cannot hold these {values.dtype} values "
            f"({values.min()} to {values.max()}); rename the field to store it as an extra one"
        )


def _require_extra_dimension(path: Path, name: str, values: Field) -> None:
    if (
        values.dtype.kind not in "biuf"
        or values.dtype.itemsize not in (1, 2, 4, 8)
        or (values.dtype.kind == "f" and values.dtype.itemsize == 2)
    ):
        raise InvalidInput(f"{path}: LAS cannot hold field {name} of type {values.dtype}")
    if name in _COORDINATES or not 0 < len(name.encode()) <= _MAX_NAME_SIZE:
        raise InvalidInput(
            f"{path}: a field name of LAS must have 1 to {_MAX_NAME_SIZE} bytes and not be x, y or "
            f"z, got {name!r}; rename it"
        )


def _laspy(path: Path) -> Any:
    try:
        return importlib.import_module("laspy")
    except ModuleNotFoundError as error:
        raise MissingExtra(f'{path}: LAS needs laspy: pip install "scanlock[las]"') from error


def _require_backend(laspy: Any, path: Path, *, compressed: bool) -> None:
    if compressed and not laspy.LazBackend.detect_available():
        raise MissingExtra(f'{path}: LAZ needs a decompressor: pip install "scanlock[las]"')


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
