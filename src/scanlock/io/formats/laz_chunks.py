"""The sizes that a LAZ file announces, checked before its decompressor believes them.

From LAS 1.4 on each chunk holds its first point as it is, the number of points, the sizes of its
layers, and the layers. The decompressor makes room for a layer, or for a chunk, of any size that it
is told, up to 4 GiB, and takes the whole process down where there is none.
"""

import importlib
import io
import struct
from pathlib import Path
from typing import Any

from scanlock.io.errors import malformed

_LAYERED = 3
"""The way of compressing that has layers."""

_LAYERS = {10: 9, 11: 1, 12: 2, 13: 1}
"""Of the items of a point: the point itself, colours, colours with near infrared, wave packets."""

_MOST_POINTS = 1_000_000
"""Of a chunk in a file that holds fewer: chunks have 50,000 unless asked for another size."""

_EXTRA_BYTES = 14
"""The item of bytes of one's own: a layer each."""

_REMEDY = "the file is cut short or damaged; copy it again"


def check_chunks(laspy: Any, path: Path, data: bytes) -> None:
    """Raise `FormatError` unless layers fit into chunks, and chunks into the file.

    Damaged headers raise what laspy and its decompressor raise.
    """
    header = laspy.LasHeader.read_from(io.BytesIO(data))
    (start,) = struct.unpack_from("<I", data, 96)
    (row_size,) = struct.unpack_from("<H", data, 105)
    record = header.vlrs.get("LasZipVlr")[0].record_data
    (way,) = struct.unpack_from("<H", record)
    lazrs = importlib.import_module("lazrs")
    place = io.BytesIO(data)
    place.seek(start)
    chunks = lazrs.read_chunk_table(place, lazrs.LazVlr(record))
    for points, _ in chunks:
        if not 0 < points <= max(header.point_count, _MOST_POINTS):
            raise malformed(
                path,
                "header",
                expected=f"chunks of one to the file's {header.point_count} points",
                found=f"chunks of {points}",
                remedy=_REMEDY,
            )
    (count,) = struct.unpack_from("<H", record, 32)
    items = [struct.unpack_from("<HH", record, 34 + 6 * one) for one in range(count)]
    held = sum(size for _, size in items)
    if held != row_size:
        raise malformed(
            path,
            "header",
            expected=f"items that make up the {row_size} bytes of a point",
            found=f"items of {held}",
            remedy=_REMEDY,
        )
    if way != _LAYERED:
        return
    layers = sum(size if kind == _EXTRA_BYTES else _LAYERS.get(kind, 0) for kind, size in items)
    at = start + 8
    for _, size in chunks:
        head = row_size + 4 + 4 * layers
        fits = head <= size <= len(data) - at
        sizes = struct.unpack_from(f"<{layers}I", data, at + row_size + 4) if fits else ()
        if not fits or head + sum(sizes) > size:
            raise malformed(
                path,
                f"byte {at}",
                expected=f"a chunk of at most {len(data) - at} bytes, layers and all",
                found=f"{head + sum(sizes)} bytes in {size}",
                remedy=_REMEDY,
            )
        at += size
