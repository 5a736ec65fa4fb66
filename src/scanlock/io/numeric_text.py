"""Reading and writing of numbers as text, for ascii PCD, ascii PLY, tables and poses."""

import io
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scanlock.errors import FormatError
from scanlock.io.errors import malformed

SEPARATORS = bytes.maketrans(b",;\t\"'", b"     ")
"""Translation of separators and quotes of a table to spaces."""

_COMMENT = re.compile(rb"(?:#|//|%)[^\n]*")

_EXACT_INTEGER = 2.0**53
"""Largest integer up to which float64 is exact."""

_BLANK = np.zeros(256, dtype=np.bool_)
_BLANK[list(b" \t\n\r\v\f")] = True

# True for bytes that do not occur in integers.
_NOT_INTEGER = np.ones(256, dtype=np.bool_)
_NOT_INTEGER[list(b"+-0123456789 \t\r\n\v\f")] = False

_NUMBER = re.compile(
    rb"[+-]?(?:(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|nan|inf(?:inity)?)", re.IGNORECASE
)

_REMEDY = "the file is cut short or damaged, or is not a plain table of numbers"


def parse_rows(
    path: Path, text: bytes, *, first_line: int = 1, width: int | None = None
) -> list[NDArray[Any]]:
    r"""Parse lines of whitespace-separated numbers; blank lines are skipped.

    Parameters
    ----------
    path : Path
        The file, for messages.
    text : bytes
        Lines that end in ``\n``, of numbers, ``nan``, ``inf`` and white space.
    first_line : int
        Line of the file at which `text` begins.
    width : int, optional
        Number of columns; that of the first line by default.

    Returns
    -------
    list of (n,) arrays
        Columns: int64 (or uint64) where every token is an integer, else float64. Empty without
        rows.

    Raises
    ------
    FormatError
        A line with another number of tokens, or a token that is not a number; the message gives
        the line.
    """
    text = text.replace(b"\r", b" ")
    data = np.frombuffer(text, dtype=np.uint8)
    blank = _BLANK[data]
    # Padding with white space on both sides gives the first and the last token edges.
    padded = np.concatenate(([True], blank, [True]))
    starts = np.flatnonzero(padded[:-1] & ~padded[1:])
    if len(starts) == 0:
        return []
    rows, width = _require_one_width(path, text, first_line, starts, width)
    try:
        values = np.loadtxt(io.StringIO(text.decode("ascii", "replace")), comments=None, ndmin=2)
    except ValueError:
        raise _unreadable(path, text, first_line) from None
    # Unicode white space splits tokens for NumPy that were counted as one above.
    if values.shape != (rows, width):
        raise _unreadable(path, text, first_line)
    ends = np.flatnonzero(~padded[:-1] & padded[1:])
    non_integers = np.concatenate(([0], np.cumsum(_NOT_INTEGER[data])))
    is_whole = non_integers[ends] == non_integers[starts]
    return [
        _column(
            values[:, k], bool(is_whole[k::width].all()), text, starts[k::width], ends[k::width]
        )
        for k in range(width)
    ]


def without_comments(text: bytes) -> bytes:
    """Return the text without comments, from ``#``, ``//`` or ``%`` to the end of a line."""
    if b"#" in text or b"//" in text or b"%" in text:
        return _COMMENT.sub(b"", text)
    return text


def first_line(body: bytes) -> tuple[int, int]:
    """Return the start and the end of the first line that is not blank."""
    match = re.search(rb"\S", body)
    if match is None:
        return len(body), len(body)
    end = body.find(b"\n", match.start())
    return match.start(), end if end >= 0 else len(body)


def is_numeric_line(line: bytes) -> bool:
    """Return whether a line of a table consists of numbers only."""
    return all(is_number(token) for token in line.translate(SEPARATORS).split())


def is_number(token: bytes) -> bool:
    """Return whether a token is a decimal number, ``nan`` or ``inf``."""
    return _NUMBER.fullmatch(token) is not None


def truncation_notes(text: bytes) -> tuple[str, ...]:
    """Return a note if the last line has no end: its last number may have lost digits."""
    if text.endswith((b"\n", b"\r")):
        return ()
    return ("the last line has no line end: the file may be cut short",)


def as_declared_type(
    path: Path, column: NDArray[Any], dtype: np.dtype[Any], name: str, where: str
) -> NDArray[Any]:
    """Convert a text column to the type that the header declares.

    Parameters
    ----------
    path : Path
    column : (n,)
    dtype : dtype
    name, where : str
        Name of the column and its location, for messages.

    Raises
    ------
    FormatError
        A value that the type cannot hold.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        cast = column.astype(dtype)
        is_equal = np.isinf(cast) == np.isinf(column) if dtype.kind == "f" else cast == column
    if not is_equal.all():
        row = int(np.flatnonzero(~is_equal)[0])
        raise malformed(
            path,
            where,
            expected=f"{name} of type {dtype.name}",
            found=f"{column[row]} in row {row + 1} of the data",
            remedy="correct the type in the header, or the value",
        )
    return cast


def formatted(column: NDArray[Any]) -> NDArray[np.str_]:
    """Return the shortest text of each value from which the same value is read."""
    if column.dtype.kind == "b":
        column = column.astype(np.uint8)
    if column.dtype == np.float64:
        return np.array([repr(value) for value in column.tolist()])
    return column.astype(np.str_)


def table_lines(columns: Sequence[NDArray[Any]], separator: str) -> bytes:
    """Return one line of `separator`-joined values per row, at full precision."""
    texts = [formatted(column).tolist() for column in columns]
    return ("\n".join(map(separator.join, zip(*texts, strict=True))) + "\n").encode("ascii")


def _column(
    values: NDArray[np.float64],
    is_whole: bool,
    text: bytes,
    starts: NDArray[np.int64],
    ends: NDArray[np.int64],
) -> NDArray[Any]:
    if not is_whole or not np.isfinite(values).all():
        return np.ascontiguousarray(values)
    if np.abs(values).max() < _EXACT_INTEGER:
        return values.astype(np.int64)
    # Large integers such as nanosecond stamps are parsed again, exactly.
    exact = [int(text[a:b]) for a, b in zip(starts.tolist(), ends.tolist(), strict=True)]
    if min(exact) >= -(2**63) and max(exact) < 2**63:
        return np.array(exact, dtype=np.int64)
    if min(exact) >= 0 and max(exact) < 2**64:
        return np.array(exact, dtype=np.uint64)
    return np.ascontiguousarray(values)


def _require_one_width(
    path: Path, text: bytes, first_line: int, starts: NDArray[np.intp], required: int | None
) -> tuple[int, int]:
    """Return the number of filled lines and of tokens per line; raise if a line differs."""
    line_ends = np.append(
        np.flatnonzero(np.frombuffer(text, dtype=np.uint8) == ord("\n")), len(text)
    )
    per_line = np.diff(np.searchsorted(starts, line_ends), prepend=0)
    filled = np.flatnonzero(per_line)
    width = int(per_line[filled[0]]) if required is None else required
    odd = filled[per_line[filled] != width]
    if len(odd) == 0:
        return len(filled), width
    error = _bad_token(path, text, first_line, (int(filled[0]), int(odd[0])))
    if error is not None:
        raise error
    reason = "" if required is not None else f" as on line {first_line + int(filled[0])}"
    raise malformed(
        path,
        f"line {first_line + int(odd[0])}",
        expected=f"{width} numbers{reason}",
        found=f"{int(per_line[odd[0]])}",
        remedy=_REMEDY,
    )


def _unreadable(path: Path, text: bytes, first_line: int) -> FormatError:
    found = _bad_token(path, text, first_line, range(text.count(b"\n") + 1))
    return found or FormatError(f"{path}: the numbers could not be read; {_REMEDY}")


def _bad_token(path: Path, text: bytes, first_line: int, rows: Iterable[int]) -> FormatError | None:
    """Return the error for the first token on these lines, from 0, that is not a number."""
    lines = text.split(b"\n")
    for k in rows:
        for token in lines[k].split():
            if not is_number(token):
                shown = token[:40].decode("ascii", "backslashreplace")
                return malformed(
                    path,
                    f"line {first_line + k}",
                    expected="a number",
                    found=repr(shown),
                    remedy=_REMEDY,
                )
    return None
