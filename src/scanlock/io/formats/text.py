"""Text tables of numbers: .xyz, .txt, .csv, .asc, and .3d of 3DTK."""

import re
from pathlib import Path
from typing import BinaryIO

import numpy as np

from scanlock.errors import FormatError, InvalidInput
from scanlock.io.column_order import refuse_other_order
from scanlock.io.columns import (
    Request,
    find_coordinates,
    numbered_names,
    require_writable_names,
)
from scanlock.io.errors import malformed
from scanlock.io.formats.text_lines import require_text
from scanlock.io.numeric_text import (
    SEPARATORS,
    first_line,
    is_numeric_line,
    parse_rows,
    table_lines,
    truncation_notes,
    without_comments,
)
from scanlock.io.scan_file import Field, ScanFile, flat_fields, scan_from_columns

_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+(?:[eE][+-]?\d+)?")
_POSE_TOLERANCE = 1e-3
"""Maximum deviation from rotations or unit quaternions at which rows are taken for poses."""

_PREVIEW_BYTES = 1 << 16
_PREVIEW_LINES = 20
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"


def read_text(path: Path, data: bytes, columns: Request) -> ScanFile:
    """Read a table with one point per line.

    Columns are separated by commas, semicolons, tabs or spaces, whatever the extension. Comments
    start with ``#``, ``//`` or ``%``. Names of columns come from a first line that is not numeric,
    or from the last comment before the numbers, and `columns` chooses among them; else `columns`
    names the columns. By default, the first three columns are x, y and z; a table of which the
    first column looks like times, indices or intensities is refused.
    """
    body, notes = _uncommented(path, data)
    start, end = first_line(body)
    line = body[:start].count(b"\n") + 1
    names: list[str] | None = None
    if not is_numeric_line(body[start:end]):
        names = _split_names(body[start:end].decode("utf-8", "replace"))
        body = body[:start] + body[end:]
    body, guesses = _separated_by_spaces(body)
    table = parse_rows(path, body)
    rows = len(table[0]) if table else 0
    if rows == 0:
        raise malformed(
            path,
            f"after line {line}",
            expected="at least one line of numbers",
            found="none",
            remedy="the file is cut short; copy or write it again",
        )
    if names is None:
        names = _commented_names(data[:_PREVIEW_BYTES], len(table))
    if names is None and columns is None:
        _refuse_trajectory(path, table)
        refuse_other_order(path, table)
    return scan_from_columns(
        path,
        _final_names(path, names, columns, len(table)),
        table,
        request=columns,
        named=names is not None,
        format="txt",
        encoding="ascii",
        notes=(*notes, *guesses),
    )


def write_text(path: Path, handle: BinaryIO, scan: ScanFile, encoding: str) -> None:
    """Write one point per line, with the shortest digits from which the same value is read.

    A .csv file has commas and a line of names. Other files have spaces and, if there are fields, a
    comment with the names.
    """
    fields = flat_fields(path, scan)
    require_writable_names(path, fields)
    names = ["x", "y", "z", *fields]
    columns: list[Field] = [*scan.points.astype(scan.coordinate_dtype).T, *fields.values()]
    for name, values in zip(names, columns, strict=True):
        if values.dtype.kind not in "biuf" or values.dtype.itemsize > 8:
            raise InvalidInput(f"{path}: text cannot hold field {name} of type {values.dtype}")
        if re.search("[,;\"'#%]|//", name):
            raise InvalidInput(f"{path}: a column of text cannot be named {name!r}; rename it")
    suffix = path.suffix.lower()
    separator = "," if suffix == ".csv" else " "
    if suffix == ".csv":
        handle.write((",".join(names) + "\n").encode("ascii"))
    elif fields:
        handle.write(f"# {' '.join(names)}\n".encode("ascii"))
    handle.write(table_lines(columns, separator))


def _uncommented(path: Path, data: bytes) -> tuple[bytes, list[str]]:
    """Return the text with its comments removed but all lines kept, and notes on the file."""
    data = require_text(path, data)
    notes: list[str] = []
    if path.suffix.lower() == ".3d":
        notes.append("3DTK uses centimetres and a left-handed frame; values are as stored")
    notes += truncation_notes(data)
    if b"\n" not in data:
        data = data.replace(b"\r", b"\n")
    return without_comments(data), notes


def _separated_by_spaces(body: bytes) -> tuple[bytes, list[str]]:
    """Return the text with white space as its only separator, and notes on guesses."""
    if not any(mark in body for mark in (b",", b";", b'"', b"'")):
        return body, []
    guesses: list[str] = []
    start, _ = first_line(body)
    preview = body[start : start + _PREVIEW_BYTES].decode("ascii", "replace").splitlines()
    if _has_decimal_commas([line for line in preview if line.strip()][:_PREVIEW_LINES]):
        body = body.replace(b",", b".")
        guesses.append("commas read as decimal points, since every cell has at most one")
    # Empty cells become NaN; else the following cells of the row would shift.
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
    """Return the names of the last comment before the numbers that fits the columns, if any."""
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


def _final_names(
    path: Path, header: list[str] | None, columns: Request, width: int
) -> tuple[str, ...]:
    if header is not None:
        if len(header) != width:
            raise _column_error(path, f"a number for each of {', '.join(header)}", width)
        return tuple(header)
    if width < 3 and columns is None:
        raise _column_error(path, "at least three columns", width)
    return numbered_names(width)


def _refuse_trajectory(path: Path, table: list[Field]) -> None:
    """Raise `FormatError` for unnamed columns that are poses: 12 of KITTI, or 8 of TUM."""
    if len(table) not in (8, 12):
        return
    values = np.stack([np.asarray(column, dtype=np.float64) for column in table], axis=1)
    if len(table) == 12:
        rotations = values.reshape(-1, 3, 4)[:, :, :3]
        deviation = np.abs(rotations @ rotations.transpose(0, 2, 1) - np.eye(3)).max(initial=0.0)
    else:
        deviation = np.abs(np.linalg.norm(values[:, 4:], axis=1) - 1.0).max(initial=0.0)
    if deviation < _POSE_TOLERANCE:
        raise malformed(
            path,
            "data",
            expected="points",
            found=f"{len(values)} poses of a trajectory ({len(table)} numbers per line)",
            remedy="pass the file as poses, or name its columns with columns=",
        )


def _column_error(path: Path, expected: str, width: int) -> FormatError:
    return malformed(
        path,
        "data",
        expected=expected,
        found=f"{width} columns",
        remedy="name every column with columns=, or correct the line of names",
    )
