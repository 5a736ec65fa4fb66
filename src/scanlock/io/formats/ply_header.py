"""Header of a PLY file."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from scanlock.io.errors import malformed

_TYPES = {
    "char": "i1",
    "uchar": "u1",
    "short": "i2",
    "ushort": "u2",
    "int": "i4",
    "uint": "u4",
    "float": "f4",
    "double": "f8",
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "float32": "f4",
    "float64": "f8",
    # Not in the original specification, but written by several tools.
    "int64": "i8",
    "uint64": "u8",
}
_BYTE_ORDERS = {"ascii": "<", "binary_little_endian": "<", "binary_big_endian": ">"}
_MAX_HEADER_SIZE = 1 << 20
_REMEDY = "the file is cut short, damaged, or not a PLY file; write it again"


@dataclass(frozen=True, kw_only=True, slots=True)
class PlyProperty:
    """One property of an element: a scalar, or a list with its own length in each row."""

    name: str
    """Name in the file."""

    dtype: np.dtype[Any]
    """Type of the value, or of each entry of the list, in the byte order of the file."""

    length_dtype: np.dtype[Any] | None
    """Type of the length of a list; None for a scalar."""


@dataclass(frozen=True, kw_only=True, slots=True)
class PlyElement:
    """One kind of rows: vertex, face, ..."""

    name: str
    """Name in the file."""

    count: int
    """Number of rows."""

    properties: tuple[PlyProperty, ...]
    """Properties in file order."""

    @property
    def has_lists(self) -> bool:
        """Whether rows may differ in size."""
        return any(entry.length_dtype is not None for entry in self.properties)

    @property
    def row_dtype(self) -> np.dtype[Any]:
        """Packed type of a row without lists."""
        return np.dtype([(f"f{k}", entry.dtype) for k, entry in enumerate(self.properties)])


@dataclass(frozen=True, kw_only=True, slots=True)
class PlyHeader:
    """Contents of the header."""

    encoding: str
    """Encoding: ``"ascii"``, ``"binary_little_endian"`` or ``"binary_big_endian"``."""

    elements: tuple[PlyElement, ...]
    """Elements in file order."""

    offset: int
    """Offset of the data [bytes]."""

    lines: int
    """Number of lines of the header."""


def parse_header(path: Path, data: bytes) -> PlyHeader:
    """Parse the header of a PLY file.

    Raises
    ------
    FormatError
        A line that does not follow the format; the message gives its number.
    """
    end_of_line = b"\r" if data.startswith(b"ply\r") and not data.startswith(b"ply\r\n") else b"\n"
    parser = _HeaderParser(path)
    offset = 0
    while not parser.ended:
        end = data.find(end_of_line, offset, offset + _MAX_HEADER_SIZE)
        if end < 0 or offset > _MAX_HEADER_SIZE:
            parser.line += 1
            parser.fail("a header that ends in end_header", "the end of the file")
        parser.feed(data[offset:end].decode("ascii", "backslashreplace").split())
        offset = end + 1
    return parser.header(offset)


class _HeaderParser:
    """Parser of header lines, one at a time."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.line = 0
        self.ended = False
        self.encoding = ""
        self.names: list[tuple[str, int]] = []
        self.properties: list[list[PlyProperty]] = []

    def feed(self, words: list[str]) -> None:
        self.line += 1
        if self.line == 1:
            if words != ["ply"]:
                self.fail("'ply'", repr(" ".join(words)[:40]))
            return
        match words:
            case [] | ["comment", *_] | ["obj_info", *_]:
                pass
            case ["format", encoding, "1.0"] if encoding in _BYTE_ORDERS and not self.encoding:
                self.encoding = encoding
            case ["element", name, count] if _is_count(count) and self.encoding:
                self.names.append((name, int(count)))
                self.properties.append([])
            case ["property", "list", length, kind, name] if self.names:
                if self.dtype(length).kind == "f":
                    self.fail("a whole-number type for the list length", repr(length))
                self.add(name, kind, self.dtype(length))
            case ["property", kind, name] if self.names:
                self.add(name, kind, None)
            case ["end_header"]:
                self.ended = True
            case _:
                self.fail(
                    "format, comment, obj_info, element, property or end_header",
                    repr(" ".join(words)[:60]),
                )

    def add(self, name: str, kind: str, length_dtype: np.dtype[Any] | None) -> None:
        entry = PlyProperty(name=name, dtype=self.dtype(kind), length_dtype=length_dtype)
        self.properties[-1].append(entry)

    def dtype(self, kind: str) -> np.dtype[Any]:
        if kind not in _TYPES:
            self.fail(f"a type among {', '.join(_TYPES)}", repr(kind))
        return np.dtype(_BYTE_ORDERS[self.encoding] + _TYPES[kind])

    def header(self, offset: int) -> PlyHeader:
        elements = tuple(
            PlyElement(name=name, count=count, properties=tuple(properties))
            for (name, count), properties in zip(self.names, self.properties, strict=True)
        )
        vertices = [element for element in elements if element.name == "vertex"]
        usable = len(vertices) == 1 and vertices[0].count > 0 and bool(vertices[0].properties)
        if not usable or vertices[0].has_lists:
            described = ", ".join(f"{e.count} {e.name}" for e in elements) or "no elements"
            self.fail("one element vertex with rows and scalar properties only", described)
        return PlyHeader(encoding=self.encoding, elements=elements, offset=offset, lines=self.line)

    def fail(self, expected: str, found: str) -> NoReturn:
        raise malformed(
            self.path, f"line {self.line}", expected=expected, found=found, remedy=_REMEDY
        )


def _is_count(word: str) -> bool:
    return word.isascii() and word.isdecimal() and len(word) < 19
