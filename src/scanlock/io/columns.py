"""Names of the columns of a scan, and detection of its coordinates."""

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from scanlock.errors import InvalidInput

Columns = int | str | Sequence[str] | None
"""Columns of a file without names, as the caller gives them: number, names, or None (guessed)."""

_CONVENTIONAL = ("x", "y", "z", "intensity", "ring")
_PLAIN = ("x", "y", "z")
_COORDINATE = re.compile(
    # x, X, x_m, x(m), x[m], point_x, //x; and ParaView's Points:0, Points_m_XYZ:0
    r"^(?:/*|point_|pos_)(?P<axis>[xyz])(?:_m|\(m\)|\[m\])?$|^points(?:_m_xyz)?:(?P<index>[012])$",
    re.IGNORECASE,
)


def conventional_names(count: int) -> tuple[str, ...]:
    """Return x, y, z, intensity, ring, column_6, ...: conventional names of unnamed columns."""
    extra = tuple(f"column_{k + 1}" for k in range(len(_CONVENTIONAL), count))
    return (*_CONVENTIONAL[:count], *extra)


def numbered_names(count: int) -> tuple[str, ...]:
    """Return x, y, z, column_4, column_5, ...: neutral names from the fourth column on."""
    return ("x", "y", "z", *(f"column_{k + 1}" for k in range(3, count)))


def requested_names(columns: Columns) -> tuple[str, ...] | int | None:
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
    names = re.split(r"[\s,]+", columns.strip()) if isinstance(columns, str) else list(columns)
    if len(set(names)) != len(names):
        raise InvalidInput(f"columns must have unique names, got {names}")
    if find_coordinates(names) is None:
        raise InvalidInput(f"columns must name x, y and z, got {names}")
    return tuple(names)


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
