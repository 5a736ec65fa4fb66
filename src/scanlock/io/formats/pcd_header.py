"""Header of a PCD file."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from scanlock.errors import FormatError, InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.geometry.quaternions import pose_from_quaternion
from scanlock.io.errors import malformed

PADDING = "_"
"""Name of fields that are padding."""

_TYPES = {
    ("F", 4): "<f4",
    ("F", 8): "<f8",
    **{(kind, size): f"<{kind.lower()}{size}" for kind in "IU" for size in (1, 2, 4, 8)},
}
_KEYS = (
    "VERSION",
    "FIELDS",
    "COLUMNS",
    "SIZE",
    "TYPE",
    "COUNT",
    "WIDTH",
    "HEIGHT",
    "VIEWPOINT",
    "POINTS",
    "DATA",
)
_ENCODINGS = ("ascii", "binary", "binary_compressed")
_MAX_HEADER_SIZE = 65536
_REMEDY = "the file is cut short, damaged, or not a PCD file; write it again"


@dataclass(frozen=True, kw_only=True, slots=True)
class PcdField:
    """One entry of FIELDS: `count` values of one type per point."""

    name: str
    """Name of the field; `PADDING` for bytes to skip."""

    dtype: np.dtype[Any]
    """Type of each value, little-endian."""

    count: int
    """Number of values per point."""


@dataclass(frozen=True, kw_only=True, slots=True)
class PcdHeader:
    """Contents of the header."""

    fields: tuple[PcdField, ...]
    """Fields in file order, including padding."""

    width: int
    """Number of columns of an organised cloud, else of all points."""

    height: int
    """Number of rows of an organised cloud, else 1."""

    viewpoint: Pose | None
    """Pose of the sensor; None without a VIEWPOINT line."""

    encoding: str
    """Encoding: ``"ascii"``, ``"binary"`` or ``"binary_compressed"``."""

    offset: int
    """Offset of the data [bytes]."""

    lines: int
    """Number of lines of the header."""

    notes: tuple[str, ...] = ()
    """Notes on entries that were inferred."""

    @property
    def points(self) -> int:
        """Number of points."""
        return self.width * self.height

    @property
    def row_size(self) -> int:
        """Size of one point [bytes]."""
        return sum(field.dtype.itemsize * field.count for field in self.fields)


def parse_header(path: Path, data: bytes) -> PcdHeader:
    """Parse the header of a PCD file.

    Raises
    ------
    FormatError
        A line that does not follow the format; the message gives its number.
    """
    entries: dict[str, tuple[int, list[str]]] = {}
    offset = 0
    line = 0
    while "DATA" not in entries:
        end = data.find(b"\n", offset, offset + _MAX_HEADER_SIZE)
        if end < 0 or offset > _MAX_HEADER_SIZE:
            raise malformed(
                path,
                f"line {line + 1}",
                expected="a header that ends in a DATA line",
                found="the end of the file" if end < 0 else f"{_MAX_HEADER_SIZE} bytes without one",
                remedy=_REMEDY,
            )
        words = data[offset:end].decode("ascii", "backslashreplace").split()
        offset = end + 1
        line += 1
        if not words or words[0].startswith("#"):
            continue
        key = words[0].upper()
        if key not in _KEYS or key in entries:
            raise malformed(
                path,
                f"line {line}",
                expected=f"one of {', '.join(key for key in _KEYS if key not in entries)}",
                found=repr(" ".join(words)[:60]),
                remedy=_REMEDY,
            )
        entries[key] = line, words[1:]
    return _HeaderLines(path, entries).header(offset, line)


class _HeaderLines:
    """Lines of a header by key, with checks that give the line in errors."""

    def __init__(self, path: Path, entries: dict[str, tuple[int, list[str]]]) -> None:
        self.path = path
        self.entries = entries
        self.notes: list[str] = []

    def header(self, offset: int, lines: int) -> PcdHeader:
        fields = self.fields()
        width, height = self.shape()
        encoding = " ".join(self.entries["DATA"][1]).lower()
        if encoding not in _ENCODINGS:
            raise self.error("DATA", f"one of {', '.join(_ENCODINGS)}")
        viewpoint = self.viewpoint()
        return PcdHeader(
            fields=fields,
            width=width,
            height=height,
            viewpoint=viewpoint,
            encoding=encoding,
            offset=offset,
            lines=lines,
            notes=tuple(self.notes),
        )

    def fields(self) -> tuple[PcdField, ...]:
        key = "COLUMNS" if "COLUMNS" in self.entries else "FIELDS"
        names = self.words(key)
        sizes = self.integers("SIZE", len(names), minimum=1)
        kinds = self.words("TYPE", len(names))
        has_counts = "COUNT" in self.entries
        counts = self.integers("COUNT", len(names), minimum=1) if has_counts else [1] * len(names)
        fields: list[PcdField] = []
        for name, size, kind, count in zip(names, sizes, kinds, counts, strict=True):
            code = _TYPES.get((kind.upper(), size))
            if code is None:
                raise self.error("TYPE", f"F of 4 or 8 bytes, I or U of 1, 2, 4 or 8 for {name}")
            fields.append(PcdField(name=name, dtype=np.dtype(code), count=count))
        return tuple(fields)

    def shape(self) -> tuple[int, int]:
        # Files older than version 0.7 give one of WIDTH and POINTS only.
        count_key = "POINTS" if "POINTS" in self.entries else "WIDTH"
        width_key = "WIDTH" if "WIDTH" in self.entries else "POINTS"
        width = self.integers(width_key, 1)[0]
        height = self.integers("HEIGHT", 1)[0] if "HEIGHT" in self.entries else 1
        if "WIDTH" not in self.entries:
            self.notes.append("no WIDTH in the header: all POINTS read as one row")
        elif width == height == 0 and "POINTS" in self.entries:
            # Several writers leave the size of the image at zero.
            width, height = self.integers("POINTS", 1)[0], 1
            self.notes.append("WIDTH 0 and HEIGHT 0 in the header: all POINTS read as one row")
        if count_key == "POINTS" and width * height != self.integers("POINTS", 1)[0]:
            raise self.error("POINTS", f"WIDTH x HEIGHT = {width * height}")
        if width * height == 0:
            raise self.error(count_key, "at least one point")
        return width, height

    def viewpoint(self) -> Pose | None:
        if "VIEWPOINT" not in self.entries:
            return None
        words = self.words("VIEWPOINT", 7)
        try:
            x, y, z, qw, qx, qy, qz = map(float, words)
            if qw == qx == qy == qz == 0.0:
                self.notes.append("VIEWPOINT without a rotation (0 0 0 0): read as no rotation")
                qw = 1.0
            return pose_from_quaternion((x, y, z), (qw, qx, qy, qz))
        except (ValueError, InvalidInput) as error:
            raise self.error("VIEWPOINT", "tx ty tz and a unit quaternion qw qx qy qz") from error

    def words(self, key: str, count: int | None = None) -> list[str]:
        if key not in self.entries:
            raise malformed(
                self.path,
                "header",
                expected=f"a {key} line",
                found="none before DATA",
                remedy=_REMEDY,
            )
        words = self.entries[key][1]
        if not words or (count is not None and len(words) != count):
            raise self.error(key, f"{count or 'some'} entries")
        return words

    def integers(self, key: str, count: int, minimum: int = 0) -> list[int]:
        words = self.words(key, count)
        plain = all(word.isascii() and word.isdecimal() and len(word) < 19 for word in words)
        if not plain or any(int(word) < minimum for word in words):
            raise self.error(key, f"{count} whole numbers of at least {minimum}")
        return [int(word) for word in words]

    def error(self, key: str, expected: str) -> FormatError:
        line, words = self.entries[key]
        return malformed(
            self.path,
            f"line {line} ({key})",
            expected=expected,
            found=repr(" ".join(words)[:60]),
            remedy=_REMEDY,
        )
