"""OBJ of Wavefront: the vertices ``v x y z [red green blue]``, as the points of a scan."""

import re
from pathlib import Path
from typing import BinaryIO

import numpy as np

from scanlock.errors import InvalidInput
from scanlock.io.columns import Request, require_request_of_names
from scanlock.io.formats.text_lines import TextLines
from scanlock.io.numeric_text import parse_rows, table_lines, truncation_notes
from scanlock.io.scan_file import Field, ScanFile, flat_fields, scan_from_columns

_OTHER_LINE = re.compile(rb"^(?![ \t]*v[ \t])[^\n]+", re.MULTILINE)
_KEYWORD = re.compile(rb"^[ \t]*v(?=[ \t])", re.MULTILINE)
_STATEMENT = re.compile(rb"^[ \t]*([a-z]+)[ \t]", re.MULTILINE)
_LEFT_OUT = {b"f": "faces", b"l": "lines", b"p": "point lists", b"vn": "normals", b"vt": "textures"}
_NAMES = {3: (), 4: ("w",), 6: ("red", "green", "blue")}
"""Names of the columns after z by the number of columns."""


def is_obj(data: bytes) -> bool:
    """Return whether text consists of OBJ statements up to its first vertex."""
    for line in data.split(b"\n"):
        words = line.split()
        if not words or words[0].startswith(b"#"):
            continue
        if words[0] == b"v":
            return len(words) > 3
        if words[0] not in (b"o", b"g", b"mtllib", b"usemtl", b"s", b"vn", b"vt"):
            return False
    return False


def read_obj(path: Path, data: bytes, columns: Request) -> ScanFile:
    """Read the vertices; normals, textures and faces are left out, with a note.

    Raises
    ------
    FormatError
        No vertices, or vertices that are not 3, 4 or 6 numbers.
    """
    require_request_of_names(path, "OBJ", columns)
    lines = TextLines(path, data)
    # Other lines become blank, so that errors give the line of the file.
    vertices = _KEYWORD.sub(b"", _OTHER_LINE.sub(b"", lines.data))
    table = parse_rows(path, _without_comments(vertices))
    if len(table) not in _NAMES:
        raise lines.error(
            max(len(lines) - 1, 0), "vertices v x y z, with a weight or three colours", "none"
            if not table else f"vertices of {len(table)} numbers",
        )  # fmt: skip
    kinds = set(_STATEMENT.findall(lines.data))
    found = [name for key, name in _LEFT_OUT.items() if key in kinds]
    return scan_from_columns(
        path,
        ("x", "y", "z", *_NAMES[len(table)]),
        table,
        request=columns,
        format="obj",
        encoding="ascii",
        coordinate_dtype="float64",
        notes=(*((f"{', '.join(found)} left out",) if found else ()), *truncation_notes(data)),
    )


def write_obj(path: Path, handle: BinaryIO, scan: ScanFile, encoding: str) -> None:
    """Write one vertex for each point, with colours from 0 to 1 if there are any.

    Raises
    ------
    InvalidInput
        Fields other than red, green and blue.
    """
    fields = flat_fields(path, scan)
    if fields and set(fields) != set(_NAMES[6]):
        raise InvalidInput(
            f"{path}: fields of .obj must be red, green and blue, or none, got "
            f"{', '.join(fields)}; remove the others, or write .ply"
        )
    colours = [_light(fields[name]) for name in _NAMES[6]] if fields else []
    columns: list[Field] = [*scan.points.astype(scan.coordinate_dtype).T, *colours]
    rows = table_lines(columns, " ")
    handle.write(b"v " + rows[:-1].replace(b"\n", b"\nv ") + b"\n")


def _light(values: Field) -> Field:
    """Return colours from 0 to 1."""
    if values.dtype.kind == "f":
        return values
    return (values / np.iinfo(values.dtype).max).astype(np.float32)


def _without_comments(body: bytes) -> bytes:
    return re.sub(rb"#[^\n]*", b"", body) if b"#" in body else body
