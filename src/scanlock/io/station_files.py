"""Reading and writing of all stations of a file."""

import os
from collections.abc import Sequence
from pathlib import Path

from scanlock.errors import InvalidInput, require_positive
from scanlock.io.atomic import atomic_file
from scanlock.io.columns import Columns, requested_names
from scanlock.io.formats.registry import FORMATS, format_of_name, open_contents, require_format
from scanlock.io.formats.stations import Station, require_stations, split_station
from scanlock.io.scan_file import ScanFile
from scanlock.io.scans import rescaled, scan_in_format


def read_scans(
    path: str | os.PathLike[str],
    format: str | None = None,
    *,
    columns: Columns = None,
    scale: float | None = None,
) -> tuple[ScanFile, ...]:
    """Read all stations of a file: of E57, PTX and PTS, or the only scan of another format.

    Parameters
    ----------
    path, format, columns, scale
        As for `read_scan`.

    Returns
    -------
    tuple of ScanFile
        In the order of the file, each in its own frame, with its name and its pose
        ``file_from_station``.

    Raises
    ------
    FormatError
        Also for a station without points.
    FileNotFoundError, MissingExtra, InvalidInput
        As for `read_scan`.
    """
    asked = requested_names(columns)
    if scale is not None:
        require_positive("scale", scale, "m")
    path = Path(path)
    known, data = open_contents(path, format)
    if known.stations is None:
        scans = (known.read(path, data, asked),)
    else:
        stations = require_stations(path, known.stations(path, data))
        scans = tuple(station.read(asked) for station in stations)
    return scans if scale is None else tuple(rescaled(scan, scale) for scan in scans)


def list_stations(path: Path, format: str | None = None) -> tuple[Station, ...]:
    """Return the stations of a file, not yet read; none if its format holds one scan only.

    Raises
    ------
    FormatError
        A damaged file, or one without stations.
    MissingExtra
        The format needs an optional dependency that is not installed.
    """
    name = format_of_name(path) if format is None else require_format(format)
    if name is None or FORMATS[name].stations is None:
        return ()
    known, data = open_contents(path, format)
    if known.stations is None:
        return ()
    return tuple(require_stations(path, known.stations(path, data)))


def station_paths(path: Path) -> tuple[Path, ...]:
    """Return a path for each station of a file: ``site.e57#Hall``, or ``site.e57#1``.

    Stations are named if all have names of their own, else numbered from 1. A file with one scan
    gives its own path. The errors are those of `list_stations`.
    """
    stations = list_stations(path)
    if len(stations) < 2:
        return (path,)
    named = [path.with_name(f"{path.name}#{one.name}") for one in stations if "/" not in one.name]
    is_named = len(set(named)) == len(stations) and all(
        split_station(one) == (path, station.name)
        for one, station in zip(named, stations, strict=True)
    )
    if is_named:
        return tuple(named)
    return tuple(path.with_name(f"{path.name}#{k}") for k in range(1, len(stations) + 1))


def write_scans(
    path: str | os.PathLike[str], scans: Sequence[ScanFile], format: str | None = None
) -> None:
    """Write several stations to one file, each with its fields, name and pose.

    Parameters
    ----------
    path : path-like
        The file; an existing one is replaced once the new one is complete.
    scans : sequence of ScanFile
        Stations in the frames of their scanners, with ``file_from_station``; a missing pose is
        left out (E57) or no motion (PTX).
    format : {"e57", "ptx"}, optional
        By default given by the extension.

    Raises
    ------
    InvalidInput
        No scans, another format, or values that the format cannot hold.
    MissingExtra
        The format needs an optional dependency that is not installed.
    FileNotFoundError
        The folder does not exist.
    """
    path = Path(path)
    name = format_of_name(path) if format is None else require_format(format)
    write = None if name is None else FORMATS[name].write_stations
    if write is None:
        able = [key for key, known in FORMATS.items() if known.write_stations is not None]
        raise InvalidInput(
            f"{path}: stations can be written as {' or '.join(able)} only; use such an extension, "
            "or one file for each with write_scan"
        )
    if not scans:
        raise InvalidInput("scans must hold at least one scan to be written, got none")
    with atomic_file(path) as handle:
        write(path, handle, [scan_in_format(scan, str(name)) for scan in scans])
