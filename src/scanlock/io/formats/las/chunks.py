"""Validation of the chunk and layer sizes of a LAZ file before decompression.

From LAS 1.4 on, each chunk holds its first point uncompressed, the number of points, the sizes of
its layers, and the layers. The decompressor allocates chunks and layers of any announced size, up
to 4 GiB, and aborts the process if memory is exhausted.
"""

import importlib
import io
import struct
from pathlib import Path
from typing import Any

from scanlock.io.errors import malformed

_LAYERED = 3
"""Number of the compressor with layers."""

_LAYERS = {10: 9, 11: 1, 12: 2, 13: 1}
"""Number of layers by type of item: point, colours, colours with near infrared, wave packets."""

_MAX_CHUNK_POINTS = 1_000_000
"""Maximum number of points per chunk in files with fewer points; the default is 50,000."""

_EXTRA_BYTES = 14
"""Type of item for extra bytes, with one layer for each byte."""

_REMEDY = "the file is cut short or damaged; copy it again"


def check_chunks(laspy: Any, path: Path, data: bytes) -> None:
    """Raise `FormatError` unless layers fit into chunks, and chunks into the file.

    Damaged headers raise the errors of laspy and its decompressor.
    """
    header = laspy.LasHeader.read_from(io.BytesIO(data))
    (start,) = struct.unpack_from("<I", data, 96)
    (row_size,) = struct.unpack_from("<H", data, 105)
    record = header.vlrs.get("LasZipVlr")[0].record_data
    (compressor,) = struct.unpack_from("<H", record)
    lazrs = importlib.import_module("lazrs")
    stream = io.BytesIO(data)
    stream.seek(start)
    chunks = lazrs.read_chunk_table(stream, lazrs.LazVlr(record))
    for points, _ in chunks:
        if not 0 < points <= max(header.point_count, _MAX_CHUNK_POINTS):
            raise malformed(
                path,
                "header",
                expected=f"chunks of 1 to {header.point_count} points",
                found=f"chunks of {points}",
                remedy=_REMEDY,
            )
    (count,) = struct.unpack_from("<H", record, 32)
    items = [struct.unpack_from("<HH", record, 34 + 6 * one) for one in range(count)]
    total = sum(size for _, size in items)
    if total != row_size:
        raise malformed(
            path,
            "header",
            expected=f"items of {row_size} bytes in total, the size of a point",
            found=f"items of {total}",
            remedy=_REMEDY,
        )
    if compressor != _LAYERED:
        return
    layers = sum(size if kind == _EXTRA_BYTES else _LAYERS.get(kind, 0) for kind, size in items)
    offset = start + 8
    for _, size in chunks:
        head = row_size + 4 + 4 * layers
        fits = head <= size <= len(data) - offset
        sizes = struct.unpack_from(f"<{layers}I", data, offset + row_size + 4) if fits else ()
        if not fits or head + sum(sizes) > size:
            raise malformed(
                path,
                f"byte {offset}",
                expected=f"a chunk of at most {len(data) - offset} bytes that holds its layers",
                found=f"layers of {head + sum(sizes)} bytes in a chunk of {size}",
                remedy=_REMEDY,
            )
        offset += size
