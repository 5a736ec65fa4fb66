"""Tables of numbers as text: .xyz, .txt, .csv, .asc, .pts and 3DTK's .3d."""

import re
from pathlib import Path
from typing import BinaryIO

import numpy as np

from scanlock.errors import FormatError, InvalidInput
from scanlock.io.columns import find_coordinates, numbered_names, require_writable_names
from scanlock.io.errors import malformed
from scanlock.io.numeric_text import (
    SEPARATORS,
    first_line,
    is_numeric_line,
    parse_rows,
    table_lines,
    unfinished,
    without_comments,
)
from scanlock.io.scan_file import Field, ScanFile, flat_fields, scan_from_columns

_CONTROL = bytes(k for k in range(32) if k not in b"\t\n\v\f\r")
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+(?:[eE][+-]?\d+)?")
_COUNT = re.compile(rb"\d{1,18}\s*")
_POSE_TOLERANCE = 1e-3
"""How exactly rows must be rotations or unit quaternions to be taken for poses."""

_PREVIEW_BYTES = 1 << 16
_PREVIEW_LINES = 20
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"


def read_text(path: Path, data: bytes, columns: tuple[str, ...] | int | None) -> ScanFile:
    """Read a table with one point a line.

    Columns are separated by commas, semicolons, tabs or spaces, whatever the name of the file
    says. Comments start with ``#``, ``//`` or ``%``. The names of the columns come from
    `columns`, from a first line that is no number, or from the last comment before the numbers;
    without any, the first three are x, y and z.
    """
    body, notes = _uncommented(path, data)
    start, end = first_line(body)
    line = body[:start].count(b"\n") + 1
    names: list[str] | None = None
    announced: int | None = None
    if not is_numeric_line(body[start:end]):
        names = _split_names(body[start:end].decode("utf-8", "replace"))
    elif path.suffix.lower() == ".pts" and _COUNT.fullmatch(body[start:end]):
        announced = int(body[start:end])
    if names is not None or announced is not None:
        body = body[:start] + body[end:]
    body, guesses = _spaced(body)
    table = parse_rows(path, body)
    rows = len(table[0]) if table else 0
    if rows == 0 or (announced is not None and announced != rows):
        raise malformed(
            path,
            f"after line {line}",
            expected="at least one line of numbers" if announced is None else f"{announced} points",
            found=str(rows),
            remedy="the file is cut short; copy or write it again",
        )
    if names is None and columns is None:
        _require_no_trajectory(path, table)
    if names is None:
        names = _commented_names(data[:_PREVIEW_BYTES], len(table))
    settled = _settled_names(path, names, columns, len(table))
    return scan_from_columns(
        path, settled, table, format="txt", encoding="ascii", notes=(*notes, *guesses)
    )


def write_text(path: Path, handle: BinaryIO, scan: ScanFile, encoding: str) -> None:
    """Write one point a line with the shortest digits that read back exactly.

    A .csv file gets commas and a line of names; a .pts file its count. Any other gets spaces
    and, where there are fields, a comment with the names.
    """
    fields = flat_fields(path, scan)
    require_writable_names(path, fields)
    names = ["x", "y", "z", *fields]
    columns: list[Field] = [*scan.points.astype(scan.coordinate_dtype).T, *fields.values()]
    for name, values in zip(names, columns, strict=True):
        if values.dtype.kind not in "biuf" or values.dtype.itemsize > 8:
            raise InvalidInput(f"{path}: text cannot hold field {name} of type {values.dtype}")
        if re.search("[,;\"'#%]|//", name):
            raise InvalidInput(f"{path}: a column of text cannot be called {name!r}; rename it")
    suffix = path.suffix.lower()
    separator = "," if suffix == ".csv" else " "
    if suffix == ".csv":
        handle.write((",".join(names) + "\n").encode("ascii"))
    elif suffix == ".pts":
        handle.write(f"{len(scan)}\n".encode("ascii"))
    elif fields:
        handle.write(f"# {' '.join(names)}\n".encode("ascii"))
    handle.write(table_lines(columns, separator))


def _uncommented(path: Path, data: bytes) -> tuple[bytes, list[str]]:
    """Return the text with its comments blanked, lines in place, and remarks on the file."""
    data = data.removeprefix(_BYTE_ORDER_MARK)
    if len(data.translate(None, delete=_CONTROL)) != len(data):
        place = next(k for k, byte in enumerate(data) if byte in _CONTROL)
        raise malformed(
            path,
            f"byte {place}",
            expected="plain text",
            found=f"the byte 0x{data[place]:02x}",
            remedy="the file is binary or UTF-16; name its format, or save it as UTF-8",
        )
    notes: list[str] = []
    if path.suffix.lower() == ".3d":
        notes.append("3DTK keeps centimetres in a left-handed frame; the numbers are as stored")
    notes += unfinished(data)
    if b"\n" not in data:
        data = data.replace(b"\r", b"\n")
    return without_comments(data), notes


def _spaced(body: bytes) -> tuple[bytes, list[str]]:
    """Return the text with white space as its only separator, and what had to be guessed."""
    if not any(mark in body for mark in (b",", b";", b'"', b"'")):
        return body, []
    guesses: list[str] = []
    start, _ = first_line(body)
    preview = body[start : start + _PREVIEW_BYTES].decode("ascii", "replace").splitlines()
    if _has_decimal_commas([line for line in preview if line.strip()][:_PREVIEW_LINES]):
        body = body.replace(b",", b".")
        guesses.append("commas taken as decimal points, because every cell has at most one")
    # An empty cell is a missing value; without this it would shift its row.
    body = re.sub(rb"([,;])(?=[ \t]*[,;])", rb"\1nan", body)
    return body.translate(SEPARATORS), guesses


def _has_decimal_commas(lines: list[str]) -> bool:
    rows = [re.split(r"[;\s]+", line.strip()) for line in lines]
    with_comma = [cell for row in rows for cell in row if "," in cell]
    return (
        bool(with_comma)
        and all(_DECIMAL_COMMA.fullmatch(cell) for cell in with_comma)
        and all(len(row) >= 3 and "." not in "".join(row) for row in rows)
    )


def _split_names(line: str) -> list[str]:
    delimiter = next((mark for mark in ",;\t" if mark in line), None)
    cells = line.strip().rstrip(",;").split(delimiter) if delimiter else line.split()
    return [cell.strip().strip("\"'").strip() for cell in cells]


def _commented_names(head: bytes, width: int) -> list[str] | None:
    """Return the last comment before the numbers that names as many columns, x, y, z included."""
    found: list[str] | None = None
    for line in head.removeprefix(_BYTE_ORDER_MARK).splitlines():
        text = line.strip()
        if not text:
            continue
        if not text.startswith((b"#", b"//", b"%")):
            break
        names = _split_names(text.lstrip(b"#/%").decode("utf-8", "replace"))
        if len(names) == width and find_coordinates(names) is not None:
            found = names
    return found


def _settled_names(
    path: Path, header: list[str] | None, columns: tuple[str, ...] | int | None, width: int
) -> tuple[str, ...]:
    asked = len(columns) if isinstance(columns, tuple) else columns
    if asked is not None and asked != width:
        raise _column_fault(path, f"{asked} columns, as asked for", width)
    if isinstance(columns, tuple):
        return columns
    if header is not None:
        if len(header) != width:
            raise _column_fault(path, f"a number for each of {', '.join(header)}", width)
        return tuple(header)
    if width < 3:
        raise _column_fault(path, "at least three columns", width)
    return numbered_names(width)


def _require_no_trajectory(path: Path, table: list[Field]) -> None:
    """Raise `FormatError` for unnamed columns that are plainly poses: KITTI's 12, or TUM's 8."""
    if len(table) not in (8, 12):
        return
    values = np.stack([np.asarray(column, dtype=np.float64) for column in table], axis=1)
    if len(table) == 12:
        rotations = values.reshape(-1, 3, 4)[:, :, :3]
        gap = np.abs(rotations @ rotations.transpose(0, 2, 1) - np.eye(3)).max(initial=0.0)
    else:
        gap = np.abs(np.linalg.norm(values[:, 4:], axis=1) - 1.0).max(initial=0.0)
    if gap < _POSE_TOLERANCE:
        raise malformed(
            path,
            "data",
            expected="points",
            found=f"{len(values)} poses of a trajectory ({len(table)} numbers a line)",
            remedy="give it where poses are asked for, or name the columns with columns=",
        )


def _column_fault(path: Path, expected: str, width: int) -> FormatError:
    return malformed(
        path,
        "data",
        expected=expected,
        found=f"{width} columns",
        remedy="name every column with columns=, or correct the line of names",
    )
