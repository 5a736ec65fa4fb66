"""XML files of VTK for polygonal data (.vtp): the points and the point data.

Arrays are read as text, as base64 and as raw bytes behind the XML part, uncompressed or compressed
with zlib or LZMA. Written from the description of the format by Kitware.
"""

import base64
import binascii
import io
import lzma
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from scanlock.errors import FormatError
from scanlock.io.columns import Request, require_request_of_names
from scanlock.io.errors import malformed
from scanlock.io.formats.vtk.legacy_sections import named_fields
from scanlock.io.scan_file import Field, ScanFile, scan_from_columns

_TYPES = {
    **{f"Int{8 * size}": f"i{size}" for size in (1, 2, 4, 8)},
    **{f"UInt{8 * size}": f"u{size}" for size in (1, 2, 4, 8)},
    "Float32": "f4",
    "Float64": "f8",
}
_HEADERS = {"UInt32": "I", "UInt64": "Q"}
_BYTE_ORDERS = {"LittleEndian": "<", "BigEndian": ">"}
_MAX_LZMA_MEMORY = 2**28
"""Maximum memory of the decompressor [bytes]."""

_APPENDED = b"<AppendedData"
_REMEDY = "the file is cut short, damaged, or not a VTK file; write it again"


def read_vtp(path: Path, data: bytes, columns: Request) -> ScanFile:
    """Read the points and point data of all pieces of polygonal data.

    Raises
    ------
    FormatError
        A file that is cut short or damaged, or a compression that the standard library lacks.
    """
    require_request_of_names(path, "VTP", columns)
    reader = _Arrays(path, data)
    pieces: list[dict[str, Field]] = []
    for piece in reader.root.iter("Piece"):
        count = reader.count(piece, "NumberOfPoints")
        if count:
            pieces.append(_read_piece(reader, piece, count))
    if not pieces:
        raise reader.error("a piece of PolyData with points")
    names = [name for name in pieces[0] if all(name in piece for piece in pieces)]
    left_out = {name for piece in pieces for name in piece} - set(names)
    table = [np.concatenate([piece[name] for piece in pieces]) for name in names]
    return scan_from_columns(
        path,
        names,
        table,
        request=columns,
        format="vtp",
        encoding=reader.encoding,
        notes=tuple(f"array {name} left out: not in every piece" for name in sorted(left_out)),
    )


def _read_piece(reader: "_Arrays", piece: ElementTree.Element, count: int) -> dict[str, Field]:
    points = [reader.read(one, 3 * count) for one in piece.findall("Points/DataArray")]
    if len(points) != 1:
        raise reader.error("one array of points in each piece")
    arrays: dict[str, Field] = {}
    for element in piece.findall("PointData/DataArray"):
        width = reader.count(element, "NumberOfComponents", "1")
        values = reader.read(element, width * count)
        name = element.get("Name") or f"array_{len(arrays) + 1}"
        arrays[name] = values if width == 1 else values.reshape(count, width)
    axes = points[0].reshape(count, 3).T
    return {**dict(zip("xyz", axes, strict=True)), **named_fields(arrays)}


class _Arrays:
    """Reader of the data arrays of a file."""

    def __init__(self, path: Path, data: bytes) -> None:
        self.path = path
        self.encoding = ""
        if not data.rstrip().endswith(b"</VTKFile>"):
            raise self.error("</VTKFile> at the end")
        head, self.appended = _split_appended(data)
        if b"<!DOCTYPE" in head or b"<!ENTITY" in head:
            raise self.error("XML without document types")
        try:
            self.root = ElementTree.fromstring(head)
        except (ElementTree.ParseError, ValueError, LookupError) as error:
            raise self.error(f"well-formed XML ({error})") from error
        if self.root.tag != "VTKFile" or self.root.get("type") != "PolyData":
            raise self.error("a VTKFile of type PolyData")
        order = self.root.get("byte_order", "LittleEndian")
        header = self.root.get("header_type", "UInt32")
        if order not in _BYTE_ORDERS or header not in _HEADERS:
            raise self.error("byte_order LittleEndian or BigEndian, header_type UInt32 or UInt64")
        self.order = _BYTE_ORDERS[order]
        self.word = struct.Struct(self.order + _HEADERS[header])
        self.unpack = self._decompressor(self.root.get("compressor"))
        encoding = self.root.find("AppendedData")
        self.appended_encoding = "" if encoding is None else encoding.get("encoding", "base64")

    def count(self, element: ElementTree.Element, key: str, default: str = "") -> int:
        """Return a whole number among the attributes of an element."""
        word = element.get(key, default)
        if not (word.isascii() and word.isdecimal() and len(word) < 19):
            raise self.error(f"a whole number {key}, not {word[:40]!r}")
        return int(word)

    def read(self, element: ElementTree.Element, expected: int) -> Field:
        """Return the `expected` numbers of a data array."""
        code, kind = _TYPES.get(element.get("type", "")), element.get("format", "ascii")
        if code is None or kind not in ("ascii", "binary", "appended"):
            raise self.error("a data array of numbers: ascii, binary or appended")
        self.encoding = self.encoding or kind
        dtype = np.dtype(self.order + code)
        if kind == "ascii":
            return self._parsed((element.text or "").split(), expected, dtype)
        if kind == "binary":
            text = "".join((element.text or "").split()).encode("ascii", "replace")
            source = _Stream(self, text, is_raw=False)
        else:
            start = self.count(element, "offset")
            part = memoryview(self.appended)[start:]
            source = _Stream(self, part, is_raw=self.appended_encoding == "raw")
        raw = self._unpacked(source, expected * dtype.itemsize)
        return np.frombuffer(raw, dtype, expected)

    def error(self, expected: str) -> FormatError:
        """Return the error for a file that does not have the expected content."""
        return malformed(
            self.path, "contents", expected=expected, found="another content", remedy=_REMEDY
        )

    def _parsed(self, words: list[str], expected: int, dtype: np.dtype[Any]) -> Field:
        if len(words) != expected or any("_" in word for word in words):
            raise self.error(f"{expected} numbers in a data array, got {len(words)}")
        try:
            if dtype.kind == "f":
                return np.fromiter(map(float, words), np.float64, expected).astype(dtype)
            return np.fromiter(map(int, words), dtype.newbyteorder("="), expected)
        except (ValueError, OverflowError) as error:
            raise self.error(f"numbers of type {dtype.name} ({str(error)[:80]})") from error

    def _unpacked(self, source: "_Stream", size: int) -> bytes:
        """Return the `size` bytes of an array, whose header gives the sizes of its blocks."""
        if self.unpack is None:
            self._require_size(source.words(1)[0], size)
            return source.body(1, size, is_separate=False)
        blocks, full, last = source.words(3)
        self._require_size(full * (blocks - bool(last)) + last if blocks else 0, size)
        sizes = source.words(3 + blocks)[3:]
        stream = io.BytesIO(source.body(3 + blocks, sum(sizes), is_separate=True))
        wanted = [full] * blocks
        if last:
            wanted[-1] = last
        raw = b"".join(
            self.unpack(stream.read(length), one) for length, one in zip(sizes, wanted, strict=True)
        )
        self._require_size(len(raw), size)
        return raw

    def _require_size(self, found: int, size: int) -> None:
        if found != size:
            raise self.error(f"a data array of {size} bytes, got {found}")

    def _decompressor(self, name: str | None) -> Callable[[bytes, int], bytes] | None:
        if name is None:
            return None
        known = {"vtkZLibDataCompressor": _inflate, "vtkLZMADataCompressor": _unpack_lzma}
        if name not in known:
            raise FormatError(
                f"{self.path}: header: expected arrays compressed by zlib or LZMA, found {name}; "
                "write it with another compression, or as legacy .vtk"
            )

        def unpack(packed: bytes, size: int) -> bytes:
            try:
                return known[name](packed, size)
            except (zlib.error, lzma.LZMAError, EOFError) as error:
                raise self.error(f"compressed data ({error})") from error

        return unpack


class _Stream:
    """Header and data of one array, as raw bytes or as base64.

    The header and the data of a compressed array are two base64 texts, one after the other; those
    of an uncompressed array are one.
    """

    def __init__(self, owner: _Arrays, data: bytes | memoryview, *, is_raw: bool) -> None:
        self.owner = owner
        self.data = data
        self.is_raw = is_raw

    def words(self, count: int) -> list[int]:
        """Return the first `count` numbers of the header."""
        size = count * self.owner.word.size
        part = self._decoded(0, size)
        return [value for (value,) in self.owner.word.iter_unpack(part)]

    def body(self, words: int, size: int, *, is_separate: bool) -> bytes:
        """Return the `size` bytes that follow a header of that many numbers."""
        header = words * self.owner.word.size
        if is_separate and not self.is_raw:
            return self._decoded(_encoded_size(header), size)
        return self._decoded(0, header + size)[header:]

    def _decoded(self, start: int, size: int) -> bytes:
        if self.is_raw:
            part = bytes(self.data[start : start + size])
        else:
            text = bytes(self.data[start : start + _encoded_size(size)])
            try:
                part = base64.b64decode(text, validate=True)[:size]
            except binascii.Error as error:
                raise self.owner.error(f"base64 ({error})") from error
        if len(part) != size:
            raise self.owner.error(f"{size} bytes of a data array, got {len(part)}")
        return part


def _encoded_size(size: int) -> int:
    return 4 * -(-size // 3)


def _split_appended(data: bytes) -> tuple[bytes, bytes]:
    """Return the XML part as a complete document, and the appended data after the underscore."""
    tag = data.find(_APPENDED)
    end = data.find(b">", tag) if tag >= 0 else -1
    if end < 0 or data[end - 1 : end] == b"/":
        return data, b""
    start = data.find(b"_", end)
    return data[: end + 1] + b"</AppendedData></VTKFile>", data[start + 1 :] if start > 0 else b""


def _inflate(packed: bytes, size: int) -> bytes:
    return zlib.decompressobj().decompress(packed, size)


def _unpack_lzma(packed: bytes, size: int) -> bytes:
    return lzma.LZMADecompressor(memlimit=_MAX_LZMA_MEMORY).decompress(packed, size)
