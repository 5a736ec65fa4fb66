"""What the columns of a scan are called, and which of them are the coordinates."""

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from scanlock.errors import InvalidInput

Columns = int | str | Sequence[str] | None
"""The caller's word on unnamed columns: how many, or their names, or nothing (guess)."""

_CONVENTIONAL = ("x", "y", "z", "intensity", "ring")
_PLAIN = ("x", "y", "z")
_COORDINATE = re.compile(
    # x, X, x_m, x(m), x[m], point_x, //x; and ParaView's Points:0, Points_m_XYZ:0
    r"^(?:/*|point_|pos_)(?P<axis>[xyz])(?:_m|\(m\)|\[m\])?$|^points(?:_m_xyz)?:(?P<index>[012])$",
    re.IGNORECASE,
)


def conventional_names(count: int) -> tuple[str, ...]:
    """Return x, y, z, intensity, ring, column_6, ...: the usual order of unnamed columns."""
    extra = tuple(f"column_{k + 1}" for k in range(len(_CONVENTIONAL), count))
    return (*_CONVENTIONAL[:count], *extra)


def numbered_names(count: int) -> tuple[str, ...]:
    """Return x, y, z, column_4, column_5, ...: names that promise nothing past the third."""
    return ("x", "y", "z", *(f"column_{k + 1}" for k in range(3, count)))


def requested_names(columns: Columns) -> tuple[str, ...] | int | None:
    """Return the caller's column names or count, checked.

    Raises
    ------
    InvalidInput
        Fewer than three columns, a name given twice, or x, y or z missing.
    """
    if columns is None:
        return None
    if isinstance(columns, int):
        if columns < 3:
            raise InvalidInput(f"columns must be at least 3 (x, y, z), got {columns}")
        return columns
    names = re.split(r"[\s,]+", columns.strip()) if isinstance(columns, str) else list(columns)
    if len(set(names)) != len(names):
        raise InvalidInput(f"columns must differ from each other, got {names}")
    if find_coordinates(names) is None:
        raise InvalidInput(f"columns must name x, y and z, got {names}")
    return tuple(names)


def find_coordinates(names: Sequence[str]) -> tuple[int, int, int] | None:
    """Return which columns are x, y and z; None unless all three are there."""
    # The plain names win over their variants, wherever they stand.
    places = {"xyz".index(name): place for place, name in enumerate(names) if name in _PLAIN}
    for place, name in enumerate(names):
        match = _COORDINATE.match(name.strip())
        if match:
            axis = "xyz".index(match["axis"].lower()) if match["axis"] else int(match["index"])
            places.setdefault(axis, place)
    if len(places) < 3:
        return None
    return places[0], places[1], places[2]


def distinct_names(names: Sequence[str]) -> tuple[str, ...]:
    """Return the names with ``_2``, ``_3`` after those that came before."""
    taken: set[str] = set()
    distinct: list[str] = []
    for name in names:
        candidate, k = name, 2
        while candidate in taken:
            candidate, k = f"{name}_{k}", k + 1
        taken.add(candidate)
        distinct.append(candidate)
    return tuple(distinct)


def require_writable_names(path: Path, names: Iterable[str]) -> None:
    """Raise `InvalidInput` unless every name is one printable ASCII word, as headers need."""
    for name in names:
        if not re.fullmatch(r"[!-~]+", name) or name == "_":
            raise InvalidInput(
                f"{path}: a field name must be one word of ASCII characters, got {name!r}; "
                "rename it"
            )
