"""PTX, the text format of Leica Cyclone: stations on a grid, each with its pose.

A station begins with the numbers of columns and rows, the position and the axes of the scanner (4
lines of 3 numbers), and a matrix of 4 lines that maps row vectors of the station to the file. Then
come columns x rows lines ``x y z intensity [red green blue]`` in the frame of the station, column
by column, with zeros for directions without a return.
"""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.io.columns import Request, numbered_names, require_request_of_names
from scanlock.io.formats.stations import Station
from scanlock.io.formats.text_lines import TextLines
from scanlock.io.numeric_text import table_lines, truncation_notes
from scanlock.io.scan_file import Field, ScanFile, flat_fields, scan_from_columns

_HEADER_LINES = 10
_MAX_SIZE = 10**9
"""Maximum number of columns or rows."""

_NAMES = {4: ("intensity",), 6: ("red", "green", "blue"), 7: ("intensity", "red", "green", "blue")}
"""Names of the columns after z by the number of columns."""

_GRID = ("column", "row")
_IMPLIED = (*_GRID, "invalid")
"""Fields that the places of the lines and their zeros express."""


def is_ptx(data: bytes) -> bool:
    """Return whether text begins like a station of PTX."""
    lines = [line.split() for line in data.split(b"\n")[:_HEADER_LINES]]
    widths = [len(words) for words in lines]
    sizes = widths[:6] == [1, 1, 3, 3, 3, 3] and widths[6:] in ([4] * 4, [4] * 3, [4] * 2)
    return sizes and lines[0][0].isdigit() and lines[1][0].isdigit()


def ptx_stations(path: Path, data: bytes) -> list[Station]:
    """Return the stations of a PTX file.

    Raises
    ------
    FormatError
        A header that does not follow the format, or fewer lines than it announces.
    """
    lines = TextLines(path, data)
    notes = truncation_notes(data)
    stations: list[Station] = []
    number = lines.next_filled(0)
    while number < len(lines):
        width, height = _size(lines, number), _size(lines, number + 1)
        first, count = number + _HEADER_LINES, width * height
        if len(lines) - first < count:
            raise lines.error(
                number, f"{count} lines of points from line {first + 1} on",
                f"the end after {max(len(lines) - first, 0)}",
            )  # fmt: skip
        read = partial(_read_station, lines, number, (width, height), notes)
        stations.append(Station(name="", points=count, read=read))
        number = lines.next_filled(first + count)
    return stations


def write_ptx_stations(path: Path, handle: BinaryIO, scans: Sequence[ScanFile]) -> None:
    """Write stations; the fields column and row give the grid, else the rows are one column.

    Raises
    ------
    InvalidInput
        A field other than intensity, red, green, blue, column and row, or a grid with two points
        in one cell.
    """
    for scan in scans:
        columns = _written_columns(path, scan)
        width, height, cells = _grid(path, scan)
        pose = np.eye(4) if scan.file_from_station is None else scan.file_from_station.matrix
        head = [
            [width],
            [height],
            pose[:3, 3].tolist(),
            *pose[:3, :3].T.tolist(),
            *pose.T.tolist(),
        ]
        text = "".join(" ".join(map(repr, row)) + "\n" for row in head)
        handle.write(text.encode("ascii"))
        table = [_on_grid(column, cells, width * height) for column in columns]
        handle.write(table_lines(table, " "))


def write_ptx(path: Path, handle: BinaryIO, scan: ScanFile, encoding: str) -> None:
    """Write one station; see `write_ptx_stations`."""
    write_ptx_stations(path, handle, [scan])


def _size(lines: TextLines, number: int) -> int:
    word = lines.line(number) if number < len(lines) else b""
    if not word.isdigit() or not 0 < int(word[:19]) <= _MAX_SIZE:
        raise lines.error(
            min(number, len(lines) - 1),
            "the number of columns or rows of a station",
            "" if number < len(lines) else "the end of the file",
        )
    return int(word)


def _read_station(
    lines: TextLines, number: int, size: tuple[int, int], notes: tuple[str, ...], columns: Request
) -> ScanFile:
    require_request_of_names(lines.path, "PTX", columns)
    width, height = size
    lines.rows(number + 2, 4, width=3)
    matrix = np.array(lines.rows(number + 6, 4, width=4), dtype=np.float64)
    try:
        # The columns of the file are the rows here, which transposes the matrix as needed.
        pose = Pose.from_matrix(matrix)
    except InvalidInput as error:
        raise lines.error(number + 6, f"a matrix of a rotation and a translation ({error})") from (
            error
        )
    table = lines.rows(number + _HEADER_LINES, width * height)
    names = ("x", "y", "z", *_NAMES.get(len(table), numbered_names(len(table))[3:]))
    table = [_as_colour(name, part) for name, part in zip(names, table, strict=True)]
    cells = np.arange(width * height, dtype=np.int32)
    return scan_from_columns(
        lines.path,
        (*names, *_GRID),
        [*table, cells // height, cells % height],
        request=columns,
        format="ptx",
        encoding="ascii",
        coordinate_dtype="float64",
        file_from_station=pose,
        notes=notes,
    )


def _as_colour(name: str, column: Field) -> Field:
    is_colour = name in ("red", "green", "blue") and column.dtype.kind in "iu"
    fits = is_colour and column.min() >= 0 and column.max() <= 255
    return column.astype(np.uint8) if fits else column


def _written_columns(path: Path, scan: ScanFile) -> list[Field]:
    fields = {key: part for key, part in flat_fields(path, scan).items() if key not in _IMPLIED}
    colours = [name in fields for name in ("red", "green", "blue")]
    other = set(fields) - {"intensity", "red", "green", "blue"}
    if other or any(colours) != all(colours):
        raise InvalidInput(
            f"{path}: fields of PTX must be intensity, and red, green and blue together, got "
            f"{', '.join(fields)}; remove the others, or write .e57"
        )
    points = scan.points.astype(scan.coordinate_dtype)
    points[~np.isfinite(scan.points).all(axis=1)] = 0.0
    intensity = fields.get("intensity", np.full(len(scan), 0.5))
    return [
        *points.T,
        intensity,
        *(fields[name] for name in ("red", "green", "blue") if any(colours)),
    ]


def _grid(path: Path, scan: ScanFile) -> tuple[int, int, NDArray[np.int64]]:
    """Return the numbers of columns and rows, and the line of each point in the station."""
    if not set(_GRID) <= set(scan.fields):
        return 1, len(scan), np.arange(len(scan))
    column, row = (scan.fields[name].astype(np.int64) for name in _GRID)
    width, height = int(column.max()) + 1, int(row.max()) + 1
    cells = column * height + row
    if min(column.min(), row.min()) < 0 or len(np.unique(cells)) != len(cells):
        raise InvalidInput(
            f"{path}: the fields column and row must give each point a cell of its own, from 0 on; "
            "remove both to write the points as one column"
        )
    if width * height > max(100 * len(scan), 1000):
        raise InvalidInput(
            f"{path}: the fields column and row must fill their grid, got {len(scan)} points for "
            f"{width} x {height} cells; remove both to write the points as one column"
        )
    return width, height, cells


def _on_grid(column: Field, cells: NDArray[np.int64], size: int) -> Field:
    full = np.zeros(size, dtype=column.dtype)
    full[cells] = column
    return full
