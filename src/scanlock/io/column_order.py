"""Columns without names of which the first is not x: times, indices or intensities before x."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from scanlock.io.errors import malformed
from scanlock.io.scan_file import Field

_MIN_ROWS = 8
"""Minimum number of rows; fewer ascend by chance."""

_MAX_COORDINATE = 1e8
"""Largest coordinate [m] on the Earth, in any common projection; times and counters exceed it."""

_MAX_INTENSITY = 65535


def refuse_other_order(path: Path, columns: Sequence[Field]) -> None:
    """Raise `FormatError` if columns without names do not seem to begin with x, y, z.

    Three columns can only be x, y and z, so that at least four are compared.

    Parameters
    ----------
    path : Path
        The file, for messages.
    columns : sequence of (n,) arrays
        Columns in file order.

    Raises
    ------
    FormatError
        The first column counts rows or exceeds any coordinate; ascends throughout or lies in
        [0, 1] before three columns that look like coordinates; or is whole before broken numbers.
    """
    if len(columns) < 4 or len(columns[0]) < _MIN_ROWS:
        return
    first = np.asarray(columns[0], dtype=np.float64)
    later = [np.asarray(column, dtype=np.float64) for column in columns[1:4]]
    kind = _other_quantity(first, later)
    if kind is None:
        return
    name = {"times or indices": "t", "intensities, rings or labels": "i"}[kind]
    others = "".join(f" column_{k + 1}" for k in range(4, len(columns)))
    raise malformed(
        path,
        "data",
        expected="x, y, z in the first three columns",
        found=f"{kind} in the first ({first[0]:.13g}, {first[1]:.13g}, {first[2]:.13g}, ...)",
        remedy=f'pass columns="{name} x y z{others}" if that is the order, else '
        f'columns="x y z column_4{others}"',
    )


def _other_quantity(first: Field, later: Sequence[Field]) -> str | None:
    """Return the quantity that the first column seems to hold; None if it may be x."""
    if not np.isfinite(first).all():
        return None
    steps = np.diff(first)
    is_count = bool((steps == 1).all())
    if np.abs(first).min() > _MAX_COORDINATE or is_count:
        return "times or indices"
    are_coordinates = all(_is_coordinate(column) for column in later)
    if are_coordinates and (steps >= 0).all() and (steps > 0).any():
        return "times or indices"
    is_whole = bool((first == np.round(first)).all())
    if is_whole and first.min() >= 0 and first.max() <= _MAX_INTENSITY:
        return "intensities, rings or labels" if all(map(_is_broken, later[:2])) else None
    if are_coordinates and first.min() >= 0 and first.max() <= 1.0:
        return "intensities, rings or labels"
    return None


def _is_broken(column: Field) -> bool:
    """Return whether some finite number is not whole."""
    finite = column[np.isfinite(column)]
    return bool((finite != np.round(finite)).any())


def _is_coordinate(column: Field) -> bool:
    """Return whether a column varies by more than a metre, with broken and negative numbers."""
    finite = column[np.isfinite(column)]
    if len(finite) == 0 or not _is_broken(column):
        return False
    return bool(np.ptp(finite) > 1.0 and (finite.min() < 0.0 or finite.min() > _MAX_INTENSITY))
