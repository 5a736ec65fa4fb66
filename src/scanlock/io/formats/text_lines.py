"""Lines of text files of several blocks (PTX, PTS, OBJ, VTK), by number."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scanlock.io.errors import malformed
from scanlock.io.numeric_text import parse_rows

_CONTROL = bytes(k for k in range(32) if k not in b"\t\n\v\f\r")
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_REMEDY = "the file is cut short or damaged; copy or write it again"


def require_text(path: Path, data: bytes) -> bytes:
    """Return text without its byte order mark; raise `FormatError` for bytes that are no text."""
    data = data.removeprefix(_BYTE_ORDER_MARK)
    if len(data.translate(None, delete=_CONTROL)) != len(data):
        offset = next(k for k, byte in enumerate(data) if byte in _CONTROL)
        raise malformed(
            path,
            f"byte {offset}",
            expected="plain text",
            found=f"the byte 0x{data[offset]:02x}",
            remedy="the file is binary or UTF-16; pass format=, or save it as UTF-8",
        )
    return data


class TextLines:
    """Text split into lines, of which blocks are parsed on request.

    Parameters
    ----------
    path : Path
        The file, for messages.
    data : bytes
        Its contents.

    Raises
    ------
    FormatError
        Bytes that are not text.
    """

    def __init__(self, path: Path, data: bytes) -> None:
        data = require_text(path, data)
        self.path = path
        self.data = data if b"\n" in data else data.replace(b"\r", b"\n")
        ends = np.flatnonzero(np.frombuffer(self.data, dtype=np.uint8) == ord("\n"))
        if not self.data.endswith(b"\n"):
            ends = np.append(ends, len(self.data))
        self._ends = ends

    def __len__(self) -> int:
        return len(self._ends)

    def line(self, number: int) -> bytes:
        """Return a line, numbered from 0, without white space around it."""
        return self.data[self._start(number) : int(self._ends[number])].strip()

    def next_filled(self, number: int) -> int:
        """Return the number of the first line from `number` on that is not blank."""
        while number < len(self) and not self.line(number):
            number += 1
        return number

    def rows(self, first: int, count: int, width: int | None = None) -> list[NDArray[Any]]:
        """Return the columns of `count` lines of numbers.

        Raises
        ------
        FormatError
            Fewer lines, blank ones, or lines with another number of numbers.
        """
        left = len(self) - first
        if left < count:
            raise self.error(len(self) - 1, f"{count} lines of numbers", f"the end after {left}")
        text = self.data[self._start(first) : int(self._ends[first + count - 1])]
        columns = parse_rows(self.path, text, first_line=first + 1, width=width)
        found = len(columns[0]) if columns else 0
        if found != count:
            raise self.error(first, f"{count} lines of numbers", f"{count - found} blank ones")
        return columns

    def error(self, number: int, expected: str, found: str = "") -> Exception:
        """Return the error for a line, numbered from 0; by default with its beginning."""
        shown = found or repr(self.line(number)[:40].decode("ascii", "backslashreplace"))
        return malformed(
            self.path, f"line {number + 1}", expected=expected, found=shown, remedy=_REMEDY
        )

    def _start(self, number: int) -> int:
        return int(self._ends[number - 1]) + 1 if number else 0
