"""Pairs of scans to register: paths or arrays, from Python or from a table."""

import csv
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

from numpy.typing import ArrayLike

from scanlock.clouds.point_cloud import HasPoints, PointCloud
from scanlock.errors import FormatError, InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.pipelines.many.pair_row import COLUMNS

ScanSource = str | os.PathLike[str] | ArrayLike | HasPoints | PointCloud
"""A scan file, or points as `register` takes them."""

InitialPose = str | os.PathLike[str] | ArrayLike | Pose
"""A pose file, or an initial pose as `register` takes it."""

_SCANS = ("source", "target")
_KNOWN = (*_SCANS, "initial", "name")


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Pair:
    """Two scans to register, with an optional initial pose and a name."""

    source: ScanSource
    """The scan that moves: a path, or points [m]."""

    target: ScanSource
    """The scan that stays: a path, or points [m]."""

    initial: InitialPose | None = None
    """Initial pose, target from source: a pose file, a (4, 4) array, or a `Pose`."""

    name: str = ""
    """Name in the row of the pair; by default the names of the two files."""

    extra: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    """Further values by column, which the row of the pair repeats."""

    def __post_init__(self) -> None:
        for key in self.extra:
            if key in COLUMNS:
                raise InvalidInput(
                    f"extra must not hold a column of the results, got {key!r}; rename it"
                )
        # A plain dictionary, since a read-only view cannot be sent to another process.
        object.__setattr__(self, "extra", dict(self.extra))

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuilt, (self.source, self.target, self.initial, self.name, dict(self.extra))


def _rebuilt(
    source: ScanSource,
    target: ScanSource,
    initial: InitialPose | None,
    name: str,
    extra: Mapping[str, str],
) -> Pair:
    return Pair(source=source, target=target, initial=initial, name=name, extra=extra)


def pair_of(item: object, number: int) -> Pair:
    """Return a pair of a list, given as a `Pair` or as (source, target).

    Raises
    ------
    InvalidInput
        The item is neither.
    """
    if isinstance(item, Pair):
        pair = item
    elif isinstance(item, tuple | list) and len(item) == 2:
        pair = Pair(source=item[0], target=item[1])
    else:
        raise InvalidInput(
            f"pairs must hold (source, target) or Pair, got {type(item).__name__} as number "
            f"{number}; give an initial pose with Pair(source=, target=, initial=)"
        )
    if pair.name:
        return pair
    name = f"{_short_name(pair.source, number)} {_short_name(pair.target, number)}"
    if not is_path(pair.source) and not is_path(pair.target):
        name = f"pair {number}"
    return Pair(
        source=pair.source, target=pair.target, initial=pair.initial, name=name, extra=pair.extra
    )


def is_path(scan: object) -> bool:
    """Return whether a scan is given by its path."""
    return isinstance(scan, str | os.PathLike)


def read_pairs(path: str | os.PathLike[str]) -> Iterator[Pair]:
    """Yield the pairs of a table, one at a time.

    The table is CSV with the header ``source,target``, optionally with columns ``initial`` (a pose
    file) and ``name``. Paths are relative to the folder of the table. All other columns are
    repeated in the results.

    Parameters
    ----------
    path : path-like

    Yields
    ------
    Pair

    Raises
    ------
    FileNotFoundError
        The table does not exist.
    FormatError
        The header has no source or no target, or repeats a name of the results, or a row has
        another number of columns; the message gives the line.
    """
    path = Path(path)
    with path.open(encoding="utf-8-sig", newline="") as handle:
        lines = csv.reader(handle)
        header = [name.strip() for name in next(lines, [])]
        _check_header(path, header)
        for row in lines:
            if not any(cell.strip() for cell in row):
                continue
            if len(row) != len(header):
                raise FormatError(
                    f"{path}, line {lines.line_num}: expected {len(header)} columns as in the "
                    f"header, found {len(row)}; quote values that contain a comma"
                )
            yield _pair_of_row(path.parent, dict(zip(header, row, strict=True)))


def extra_columns(path: str | os.PathLike[str]) -> list[str]:
    """Return the columns of a table that its results repeat."""
    path = Path(path)
    with path.open(encoding="utf-8-sig", newline="") as handle:
        header = [name.strip() for name in next(csv.reader(handle), [])]
    _check_header(path, header)
    return [name for name in header if name not in _KNOWN]


def _check_header(path: Path, header: list[str]) -> None:
    missing = [name for name in _SCANS if name not in header]
    if missing:
        found = ", ".join(header) or "an empty file"
        raise FormatError(
            f"{path}, line 1: expected a header with source and target, found {found}; write "
            "source,target as the first line"
        )
    repeated = [name for name in header if header.count(name) > 1]
    taken = [name for name in header if name in COLUMNS and name not in _KNOWN]
    for name in (*repeated, *taken):
        raise FormatError(
            f"{path}, line 1: the column {name!r} is repeated or is a column of the results; "
            "rename it"
        )


def _pair_of_row(folder: Path, row: Mapping[str, str]) -> Pair:
    source, target = (str(folder / row[name].strip()) for name in _SCANS)
    initial = row.get("initial", "").strip()
    extra = {name: value for name, value in row.items() if name not in _KNOWN}
    return Pair(
        source=source,
        target=target,
        initial=str(folder / initial) if initial else None,
        name=row.get("name", "").strip(),
        extra=extra,
    )


def _short_name(scan: object, number: int) -> str:
    if isinstance(scan, str | os.PathLike):
        return Path(os.fspath(scan)).stem
    return f"array {number}"
