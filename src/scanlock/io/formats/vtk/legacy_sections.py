"""Sections of a legacy VTK file, read one after another."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from scanlock.errors import FormatError
from scanlock.io.errors import malformed
from scanlock.io.scan_file import Field

_TYPES = {
    "unsigned_char": "u1",
    "char": "i1",
    "unsigned_short": "u2",
    "short": "i2",
    "unsigned_int": "u4",
    "int": "i4",
    "unsigned_long": "u8",
    "long": "i8",
    "vtktypeuint64": "u8",
    "vtktypeint64": "i8",
    "vtkidtype": "i8",
    "float": "f4",
    "double": "f8",
}
_DATASETS = ("POLYDATA", "UNSTRUCTURED_GRID", "STRUCTURED_GRID")
_CELLS = ("VERTICES", "LINES", "POLYGONS", "TRIANGLE_STRIPS", "CELLS")
_TEXTURE_AXES = 3
_REMEDY = "the file is cut short, damaged, or not a VTK file; write it again"


@dataclass(slots=True)
class VtkContents:
    """Points and point data of a file."""

    points: NDArray[Any] = field(default_factory=lambda: np.empty((0, 3)))
    """(n, 3)"""

    fields: dict[str, Field] = field(default_factory=dict[str, Field])
    """Point data by name."""

    notes: list[str] = field(default_factory=list[str])
    """Notes on what was left out."""


class SectionReader:
    """Reader of the sections of a file, from the first to the last."""

    def __init__(self, path: Path, data: bytes) -> None:
        self.path = path
        self.data = data
        self.offset = 0
        if not self._next_line().lower().startswith(b"# vtk datafile"):
            raise self._error("a first line '# vtk DataFile Version'")
        self._next_line()
        self.encoding = self._next_line().strip().lower().decode("ascii", "replace")
        if self.encoding not in ("ascii", "binary"):
            raise self._error("ASCII or BINARY on the third line")
        words = self._next_words()
        if words[:1] != ["DATASET"] or words[1:] not in [[name] for name in _DATASETS]:
            raise self._error(f"DATASET with points: {', '.join(_DATASETS)}")

    def read(self) -> VtkContents:
        """Return the points and the point data.

        Raises
        ------
        FormatError
            A section that does not follow the format.
        """
        contents = VtkContents()
        owner = ""
        while words := self._next_words():
            match [words[0].upper(), *words[1:]]:
                case ["POINTS", count, kind]:
                    contents.points = self._values(self._count(count), 3, kind)
                    if not self.data[self.offset :].strip():
                        contents.notes.append("nothing after the points: the file may be cut short")
                case ["POINT_DATA" | "CELL_DATA" as owner, _]:
                    pass
                case ["DIMENSIONS", _, _, _]:
                    pass
                case ["METADATA", *_]:
                    self._skip_metadata()
                case [name, *sizes] if name in _CELLS and len(sizes) in (1, 2):
                    self._skip_cells(words)
                case ["CELL_TYPES", count]:
                    self._values(self._count(count), 1, "int")
                case _:
                    self._read_attribute(contents, owner, words)
        self._check(contents)
        return contents

    def _check(self, contents: VtkContents) -> None:
        count = len(contents.points)
        if count == 0:
            raise self._error("at least one point")
        for name, values in contents.fields.items():
            if len(values) != count:
                raise self._error(f"{count} values of point data {name}", str(len(values)))

    def _read_attribute(self, contents: VtkContents, owner: str, words: list[str]) -> None:
        """Read one attribute; those of the dataset itself and of cells are left out."""
        count = len(contents.points) if owner == "POINT_DATA" else None
        read: dict[str, Field] = {}
        match [words[0].upper(), *words[1:]]:
            case ["FIELD", _, number]:
                read = self._arrays(self._count(number))
            case ["SCALARS", name, kind, *width] if len(width) < 2 and count is not None:
                table = self._scalars(
                    count, int(width[0]) if width and width[0] in "1234" else 1, kind
                )
                read = {name: table}
            case ["VECTORS" | "NORMALS", name, kind] if count is not None:
                read = {name: self._values(count, 3, kind)}
            case ["TENSORS", name, kind] if count is not None:
                read = {name: self._values(count, 9, kind)}
            case ["TEXTURE_COORDINATES", name, width, kind] if count is not None:
                read = {name: self._values(count, min(self._count(width), _TEXTURE_AXES), kind)}
            case ["COLOR_SCALARS", name, width] if count is not None:
                read = {name: self._colours(count, self._count(width))}
            case ["LOOKUP_TABLE", _, size]:
                self._colours(self._count(size), 4)
            case _ if owner == "CELL_DATA":
                contents.notes.append("data of cells left out")
                self.offset = len(self.data)
            case _:
                raise self._error("a section of a dataset of points", repr(" ".join(words)[:40]))
        if owner == "POINT_DATA":
            contents.fields.update(named_fields(read))

    def _arrays(self, number: int) -> dict[str, Field]:
        arrays: dict[str, Field] = {}
        for _ in range(number):
            words = self._next_words()
            while words[:1] == ["METADATA"]:
                self._skip_metadata()
                words = self._next_words()
            if len(words) != 4:
                raise self._error("name, components, tuples and type of a field array")
            width, count = self._count(words[1]), self._count(words[2])
            arrays[unquote(words[0])] = self._values(count, width, words[3])
        return arrays

    def _scalars(self, count: int, width: int, kind: str) -> Field:
        before = self.offset
        if self._next_words()[:1] != ["LOOKUP_TABLE"]:
            self.offset = before
        return self._values(count, width, kind)

    def _colours(self, count: int, width: int) -> Field:
        """Return colours as bytes; ascii files have them from 0 to 1."""
        if self.encoding == "binary":
            return self._values(count, width, "unsigned_char")
        values = self._values(count, width, "float")
        if not (np.isfinite(values).all() and (values >= 0).all() and (values <= 1).all()):
            raise self._error("colours from 0 to 1")
        return np.round(values * 255).astype(np.uint8)

    def _skip_cells(self, words: list[str]) -> None:
        before = self.offset
        following = self._next_words()
        if following[:1] != ["OFFSETS"]:
            self.offset = before
            self._values(self._count(words[-1]), 1, "int")
            return
        sizes = [self._count(word) for word in words[1:]]
        self._values(sizes[0], 1, following[-1])
        following = self._next_words()
        if following[:1] != ["CONNECTIVITY"]:
            raise self._error("CONNECTIVITY after OFFSETS")
        self._values(sizes[-1], 1, following[-1])

    def _skip_metadata(self) -> None:
        """Skip the lines up to the next blank one."""
        while self.offset < len(self.data) and self._next_line().strip():
            pass

    def _values(self, count: int, width: int, kind: str) -> Field:
        """Return (count, width) numbers, or (count,) for one number each."""
        code = _TYPES.get(kind.lower())
        if code is None:
            raise self._error(f"a type among {', '.join(_TYPES)}", repr(kind[:40]))
        total = count * width
        if self.encoding == "binary":
            size = total * np.dtype(code).itemsize
            if size > len(self.data) - self.offset:
                raise self._error(f"{size} bytes of numbers")
            values = np.frombuffer(self.data, f">{code}", total, self.offset)
            self.offset += size
        else:
            values = self._parsed(total, np.dtype(code))
        return values if width == 1 else values.reshape(count, width)

    def _parsed(self, total: int, dtype: np.dtype[Any]) -> Field:
        words = self.data[self.offset :].split(None, total)
        rest = words.pop() if len(words) > total else b""
        if len(words) < total or b"_" in b"".join(words):
            raise self._error(f"{total} numbers", f"{len(words)} words")
        try:
            values = _numbers(words, dtype)
        except (ValueError, OverflowError) as error:
            raise self._error(
                f"{total} numbers of type {dtype.name} ({str(error)[:60]})"
            ) from error
        self.offset = len(self.data) - len(rest)
        with np.errstate(over="ignore", invalid="ignore"):
            cast = values.astype(dtype)
        if dtype.kind in "iu" and not np.array_equal(cast, values):
            raise self._error(f"numbers that fit {dtype.name}")
        return cast

    def _count(self, word: str) -> int:
        if not (word.isascii() and word.isdecimal() and len(word) < 19):
            raise self._error("a whole number", repr(word[:40]))
        return int(word)

    def _next_line(self) -> bytes:
        end = self.data.find(b"\n", self.offset)
        end = len(self.data) if end < 0 else end
        line = self.data[self.offset : end]
        self.offset = end + 1 if end < len(self.data) else end
        return line

    def _next_words(self) -> list[str]:
        """Return the words of the next filled line; none at the end of the file."""
        while self.offset < len(self.data):
            words = self._next_line().decode("ascii", "backslashreplace").split()
            if words:
                return words
        return []

    def _error(
        self, expected: str, found: str = "another content or the end of the file"
    ) -> FormatError:
        return malformed(
            self.path,
            f"byte {min(self.offset, len(self.data))}",
            expected=expected,
            found=found,
            remedy=_REMEDY,
        )


def _numbers(words: list[bytes], dtype: np.dtype[Any]) -> NDArray[Any]:
    if dtype.kind == "f":
        return np.fromiter(map(float, words), np.float64, len(words))
    kind = np.uint64 if dtype.kind == "u" else np.int64
    return np.fromiter(map(int, words), kind, len(words))


def named_fields(arrays: dict[str, Field]) -> dict[str, Field]:
    """Return colours and normals under the names of the other formats."""
    fields: dict[str, Field] = {}
    for name, values in arrays.items():
        width = values.shape[1] if values.ndim == 2 else 1
        lower = name.lower()
        names = None
        if (
            values.dtype == np.uint8
            and width in (3, 4)
            and lower in ("rgb", "rgba", "colors", "colours")
        ):
            names = ("red", "green", "blue", "alpha")[:width]
        elif width == 3 and lower == "normals":
            names = ("nx", "ny", "nz")
        if names is None or set(names) & set(arrays):
            fields[name] = values
        else:
            fields.update(zip(names, values.T, strict=True))
    return fields
