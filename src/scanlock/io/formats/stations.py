"""Stations: the scans of a file that holds several, such as E57 or PTX."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from scanlock.errors import InvalidInput
from scanlock.io.columns import Request
from scanlock.io.errors import malformed
from scanlock.io.scan_file import ScanFile

_MAX_LISTED = 20
"""Maximum number of stations that an error lists."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Station:
    """One scan of a file, not yet read."""

    name: str
    """Name in the file; empty if it has none."""

    points: int
    """Number of rows; 0 if the file does not state it."""

    read: Callable[[Request], ScanFile]
    """Function that reads the scan with the requested columns."""


Lister = Callable[[Path, bytes], Sequence[Station]]
"""Function of path and contents that returns the stations of a file."""


def split_station(path: Path) -> tuple[Path, int | str | None]:
    """Return the file and the station of a path such as ``site.e57#2`` or ``site.e57#Hall``.

    A file of the complete name takes precedence.
    """
    name, mark, station = path.name.rpartition("#")
    if not mark or not name or not station or path.exists() or not path.with_name(name).is_file():
        return path, None
    is_number = station.isascii() and station.isdecimal() and len(station) < 10
    return path.with_name(name), int(station) if is_number else station


def require_stations(path: Path, stations: Sequence[Station]) -> Sequence[Station]:
    """Return the stations; raise `FormatError` if there are none."""
    if not stations:
        raise malformed(
            path,
            "contents",
            expected="at least one scan",
            found="none",
            remedy="check the program that wrote it",
        )
    return stations


def choose_station(
    path: Path, stations: Sequence[Station], choice: int | str | None = None
) -> Station:
    """Return the station of a number (from 1) or a name.

    Raises
    ------
    FormatError
        No station in the file, or several without a choice.
    InvalidInput
        A number or name that no station, or a name that several stations have.
    """
    require_stations(path, stations)
    if choice is None:
        if len(stations) > 1:
            raise malformed(
                path,
                "contents",
                expected="one scan, or the choice of a station",
                found=f"{len(stations)} stations: {_listed(stations)}",
                remedy=f"pass station=, or name the file as {path.name}#1",
            )
        return stations[0]
    if isinstance(choice, int):
        found = [stations[choice - 1]] if 0 < choice <= len(stations) else []
    else:
        found = [one for one in stations if one.name == choice]
    if len(found) != 1:
        raise InvalidInput(
            f"{path}: station must be a number from 1 to {len(stations)}, or a name that one "
            f"station has, got {choice!r}; the stations are {_listed(stations)}"
        )
    return found[0]


def only_station(stations: Lister) -> Callable[[Path, bytes, Request], ScanFile]:
    """Return a reader of files with a single station."""

    def read(path: Path, data: bytes, columns: Request) -> ScanFile:
        return choose_station(path, stations(path, data)).read(columns)

    return read


def _listed(stations: Sequence[Station]) -> str:
    shown = [
        f"{k} {one.name!r} ({one.points:,} points)" if one.name else f"{k} ({one.points:,} points)"
        for k, one in enumerate(stations[:_MAX_LISTED], 1)
    ]
    if len(stations) > _MAX_LISTED:
        shown.append(f"and {len(stations) - _MAX_LISTED} more")
    return ", ".join(shown)
