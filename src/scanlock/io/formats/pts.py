"""PTS, the text format of Leica: the number of points, then ``x y z [intensity] [r g b]`` lines.

Files may have several such blocks, all in one frame, and some writers leave the number out.
"""

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import BinaryIO

import numpy as np

from scanlock.errors import InvalidInput
from scanlock.io.column_order import refuse_other_order
from scanlock.io.columns import Request, numbered_names, require_writable_names
from scanlock.io.formats.stations import Station
from scanlock.io.formats.text import read_text
from scanlock.io.formats.text_lines import TextLines
from scanlock.io.numeric_text import table_lines, truncation_notes
from scanlock.io.scan_file import Field, ScanFile, flat_fields, scan_from_columns

_COLOURS = ("red", "green", "blue")


def is_pts(data: bytes) -> bool:
    """Return whether text begins with a number alone, and a line of at least three numbers."""
    lines = [line for line in data.split(b"\n")[:8] if line.strip()][:2]
    return len(lines) == 2 and lines[0].strip().isdigit() and len(lines[1].split()) >= 3


def pts_stations(path: Path, data: bytes) -> list[Station]:
    """Return the blocks of a PTS file, or one for all lines if the first is no number.

    Raises
    ------
    FormatError
        Fewer lines than announced.
    """
    lines = TextLines(path, data)
    number = lines.next_filled(0)
    if number == len(lines) or not _is_count(lines.line(number)):
        return [_uncounted(path, data)]
    notes = truncation_notes(data)
    stations: list[Station] = []
    while number < len(lines):
        if not _is_count(lines.line(number)):
            raise lines.error(number, "the number of points of the next block")
        count = int(lines.line(number))
        if len(lines) - number - 1 < count:
            raise lines.error(number, f"{count} points", str(len(lines) - number - 1))
        read = partial(_read_block, lines, number + 1, count, notes)
        stations.append(Station(name="", points=count, read=read))
        number = lines.next_filled(number + 1 + count)
    return stations


def write_pts(path: Path, handle: BinaryIO, scan: ScanFile, encoding: str) -> None:
    """Write the number of points, then x, y, z, intensity, colours and other fields.

    Raises
    ------
    InvalidInput
        A field that is not numeric.
    """
    fields = flat_fields(path, scan)
    require_writable_names(path, fields)
    for name, values in fields.items():
        if values.dtype.kind not in "biuf" or values.dtype.itemsize > 8:
            raise InvalidInput(f"{path}: text cannot hold field {name} of type {values.dtype}")
    first = [name for name in ("intensity", *_COLOURS) if name in fields]
    order = [*first, *(name for name in fields if name not in first)]
    points = scan.points.astype(scan.coordinate_dtype)
    columns: list[Field] = [*points.T, *(fields[name] for name in order)]
    handle.write(f"{len(scan)}\n".encode("ascii"))
    handle.write(table_lines(columns, " "))


def _uncounted(path: Path, data: bytes) -> Station:
    def read(columns: Request) -> ScanFile:
        return replace(read_text(path, data, columns), format="pts")

    return Station(name="", points=0, read=read)


def _is_count(word: bytes) -> bool:
    return word.isdigit() and len(word) < 19


def _read_block(
    lines: TextLines, first: int, count: int, notes: tuple[str, ...], columns: Request
) -> ScanFile:
    table = lines.rows(first, count) if count else []
    names = numbered_names(max(len(table), 3))
    if columns is None and table:
        names = _names(table)
        refuse_other_order(lines.path, table)
    return scan_from_columns(
        lines.path,
        names,
        table or [np.empty(0)] * 3,
        request=columns,
        named=False,
        format="pts",
        encoding="ascii",
        notes=notes,
    )


def _names(table: list[Field]) -> tuple[str, ...]:
    """Return names for columns of points: with an intensity, colours, both, or unknown ones."""
    are_colours = [
        column.dtype.kind in "iu" and column.min() >= 0 and column.max() <= 255
        for column in table[-3:]
    ]
    if len(table) in (6, 7) and all(are_colours):
        return ("x", "y", "z", "intensity", *_COLOURS) if len(table) == 7 else (
            "x", "y", "z", *_COLOURS)  # fmt: skip
    if len(table) == 4:
        return ("x", "y", "z", "intensity")
    return numbered_names(len(table))
