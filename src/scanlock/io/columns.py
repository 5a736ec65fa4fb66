"""Names of the columns of a scan: detection of the coordinates, choice and renaming.

``"x y z label"`` names the columns of a file without names, in its order; of a file with names, it
chooses these columns. ``"x=easting y=northing z=height"`` chooses and renames columns, by their
names or by their numbers from 1. ``_`` leaves a column out.
"""

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from scanlock.errors import FormatError, InvalidInput
from scanlock.io.errors import malformed

Columns = int | str | Sequence[str] | None
"""Columns as the caller gives them: number, names, ``new=old`` pairs, or None (guessed)."""

Request = tuple[str, ...] | int | None
"""Columns as the readers get them: checked names and pairs, a number, or None."""

LEFT_OUT = "_"
"""Name of the columns that are left out."""

_CONVENTIONAL = ("x", "y", "z", "intensity", "ring")
_PLAIN = ("x", "y", "z")
_COORDINATE = re.compile(
    # x, X, x_m, x (m), x[m], point_x, //x; Ouster's X1 (m); ParaView's Points:0, Points_m_XYZ:0
    r"^(?:/*|point_|pos_)(?P<axis>[xyz])(?:_m|1? ?\(m\)| ?\[m\])?$"
    r"|^points(?:_m_xyz)?:(?P<index>[012])$",
    re.IGNORECASE,
)


def conventional_names(count: int) -> tuple[str, ...]:
    """Return x, y, z, intensity, ring, column_6, ...: conventional names of unnamed columns."""
    extra = tuple(f"column_{k + 1}" for k in range(len(_CONVENTIONAL), count))
    return (*_CONVENTIONAL[:count], *extra)


def numbered_names(count: int) -> tuple[str, ...]:
    """Return x, y, z, column_4, column_5, ...: neutral names from the fourth column on."""
    return (*_PLAIN[:count], *(f"column_{k + 1}" for k in range(3, count)))


def requested_names(columns: Columns) -> Request:
    """Check the columns that the caller gives, and return their names or number.

    Raises
    ------
    InvalidInput
        Fewer than three columns, a repeated name, or x, y or z missing.
    """
    if columns is None:
        return None
    if isinstance(columns, int):
        if columns < 3:
            raise InvalidInput(f"columns must be at least 3 (x, y, z), got {columns}")
        return columns
    entries = _split(columns) if isinstance(columns, str) else list(columns)
    names = [entry.partition("=")[0].strip() for entry in entries]
    kept = [name for name in names if name != LEFT_OUT]
    if len(set(kept)) != len(kept) or "" in kept:
        raise InvalidInput(f"columns must have unique names, got {entries}")
    if find_coordinates(kept) is None:
        raise InvalidInput(
            f"columns must name x, y and z, got {entries}; in a file with other names, give them "
            'as in "x=easting y=northing z=height"'
        )
    return tuple(entries)


def require_request_of_names(path: Path, title: str, request: Request) -> None:
    """Raise `InvalidInput` for a number of columns, in a format that names its own."""
    if isinstance(request, int):
        raise InvalidInput(
            f"{path}: columns must be names of {title}, which names its own, got the number "
            f"{request}; leave columns out"
        )


def select_columns(
    path: Path, names: Sequence[str], request: Request, *, named: bool = True
) -> list[tuple[str, int]]:
    """Return the name and the index of each column that is read.

    Parameters
    ----------
    path : Path
        The file, for messages.
    names : sequence of str
        Unique names of all columns: those of the file, or assumed ones.
    request : tuple of str or int or None
        Result of `requested_names`.
    named : bool
        Whether the names are those of the file. Otherwise the requested names are given in the
        order of the columns.

    Raises
    ------
    FormatError
        Another number of columns than requested, or a name that the file does not have.
    """
    if isinstance(request, int) and request != len(names):
        raise _missing(path, f"{request} columns, as requested", names, named)
    if not isinstance(request, tuple):
        return enumerated(names)
    wanted = [entry for entry in request if entry != LEFT_OUT]
    by_name = any("=" in entry for entry in request)
    if not by_name and not (named and all(_index(names, entry) is not None for entry in wanted)):
        if len(request) == len(names):
            return [pair for pair in enumerated(request) if pair[0] != LEFT_OUT]
        if not named:
            raise _missing(path, f"{len(request)} columns, as requested", names, named)
    chosen: list[tuple[str, int]] = []
    for entry in wanted:
        name, _, source = entry.partition("=")
        source = (source or name).strip()
        index = _index(names, source, numbers="=" in entry) if named or "=" in entry else None
        if index is None:
            raise _missing(path, f"a column {source!r}, as requested", names, named)
        chosen.append((name.strip(), index))
    return chosen


def enumerated(names: Sequence[str]) -> list[tuple[str, int]]:
    """Return pairs of name and index."""
    return [(name, index) for index, name in enumerate(names)]


def find_coordinates(names: Sequence[str]) -> tuple[int, int, int] | None:
    """Return the indices of the columns x, y and z; None unless all three exist."""
    # Plain names take precedence over their variants, whatever the order.
    axes = {"xyz".index(name): index for index, name in enumerate(names) if name in _PLAIN}
    for index, name in enumerate(names):
        match = _COORDINATE.match(name.strip())
        if match:
            axis = "xyz".index(match["axis"].lower()) if match["axis"] else int(match["index"])
            axes.setdefault(axis, index)
    if len(axes) < 3:
        return None
    return axes[0], axes[1], axes[2]


def unique_names(names: Sequence[str]) -> tuple[str, ...]:
    """Return the names with ``_2``, ``_3``, ... appended to repeated ones."""
    taken: set[str] = set()
    unique: list[str] = []
    for name in names:
        candidate, k = name, 2
        while candidate in taken:
            candidate, k = f"{name}_{k}", k + 1
        taken.add(candidate)
        unique.append(candidate)
    return tuple(unique)


def require_writable_names(path: Path, names: Iterable[str]) -> None:
    """Raise `InvalidInput` unless every name is one printable ASCII word, as headers require."""
    for name in names:
        if not re.fullmatch(r"[!-~]+", name) or name == "_":
            raise InvalidInput(
                f"{path}: a field name must be one word of ASCII characters, got {name!r}; "
                "rename it"
            )


def _split(text: str) -> list[str]:
    """Split requested columns at commas and white space; names in pairs may contain spaces."""
    if "=" in text and "," in text:
        return [entry.strip() for entry in text.split(",")]
    return re.split(r"[\s,]+", text.strip())


def _index(names: Sequence[str], source: str, *, numbers: bool = False) -> int | None:
    """Return the index of a column by its name or, if allowed, its number from 1."""
    if source in names:
        return names.index(source)
    similar = [k for k, name in enumerate(names) if name.lower() == source.lower()]
    if len(similar) == 1:
        return similar[0]
    is_number = numbers and source.isascii() and source.isdecimal() and len(source) < 10
    return int(source) - 1 if is_number and 0 < int(source) <= len(names) else None


def _missing(path: Path, expected: str, names: Sequence[str], named: bool) -> FormatError:
    return malformed(
        path,
        "data",
        expected=expected,
        found=f"{len(names)} columns" + (f": {', '.join(names)}" if named else ""),
        remedy='name every column in columns=, or choose some as in "x=2 y=3 z=4"',
    )
