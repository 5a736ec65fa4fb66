"""Files of a folder of scans in natural order, and hints where a folder holds none."""

import os
import re
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from scanlock.errors import FormatError
from scanlock.geometry.rotations import nearest_rotation
from scanlock.io.formats.registry import format_of_content, format_of_name

LAYOUTS = """\
a folder of scan files, of KITTI (raw: velodyne_points/data; odometry: velodyne), of the Ford Campus
data set (SCANS/Scan*.mat) or of scanlock simulate (scans)"""
"""The supported layouts, for messages."""

_NOTE_ENDINGS = {".txt", ".csv", ".json"}
"""Endings of notes, times and poses beside scans of another format."""

_MARKS = ("velodyne_points/data", "velodyne", "SCANS", "scans")
"""Subfolders with the scans of one sequence."""

_NAMED = 4
"""Maximum number of folders that a message names."""

_CHECKED = 50
"""Number of text files in which poses are looked for before all are."""

_PREVIEW = 8192


def require_folder(folder: Path) -> None:
    """Raise unless the path is a folder.

    Raises
    ------
    FileNotFoundError
        It does not exist.
    FormatError
        It is a file; a capture of packets or messages gets the message of its format.
    """
    if folder.is_dir():
        return
    if not folder.exists():
        raise FileNotFoundError(2, "no such folder of scans", str(folder))
    with folder.open("rb") as handle:
        format_of_content(folder, handle.read(_PREVIEW))
    raise FormatError(
        f"{folder}: expected a folder of scans, found a file; give the folder that contains it"
    )


def scan_files(folder: Path) -> tuple[Path, ...]:
    """Return the scan files of a folder in natural order: 2 before 10.

    Files of one format may have several endings, such as .las and .laz. Text files beside scans
    of another format are notes and poses, and so are text files whose rows are poses or times.

    Raises
    ------
    FormatError
        No scans, scans of several formats, or one scan with two endings; the message names
        subfolders that have scans.
    """
    # Hidden files are incomplete scans, or metadata of other systems.
    files = [path for path in folder.iterdir() if path.is_file() and path.name[0] != "."]
    found = [path for path in files if format_of_name(path) is not None]
    extensions = {path.suffix.lower() for path in found}
    if extensions - _NOTE_ENDINGS:
        extensions -= _NOTE_ENDINGS
    elif extensions <= _NOTE_ENDINGS and any(map(_is_note, found[:_CHECKED])):
        found = [path for path in found if not _is_note(path)]
    found = [path for path in found if path.suffix.lower() in extensions]
    if len({format_of_name(path) for path in found}) == 1:
        _require_one_each(folder, found)
        return natural_order(found)
    if found:
        raise FormatError(
            f"{folder}: expected {LAYOUTS}, found files of {', '.join(sorted(extensions))}; give "
            "a folder with the scans of one format only"
        )
    raise FormatError(f"{folder}: {_hint(folder, files)}")


def _require_one_each(folder: Path, paths: list[Path]) -> None:
    """Raise `FormatError` if a scan is there twice, with two endings."""
    stems = Counter(path.stem for path in paths)
    twice = natural_order(path for path in paths if stems[path.stem] > 1)
    if len({path.suffix.lower() for path in twice}) > 1:
        same = [path.name for path in twice if path.stem == twice[0].stem]
        raise FormatError(
            f"{folder}: expected each scan once, found {' and '.join(same)}; move one of them away"
        )


def natural_order(paths: Iterable[Path]) -> tuple[Path, ...]:
    """Return paths in natural order of their names: 2 before 10."""

    def key(path: Path) -> tuple[list[tuple[int, int, str]], str]:
        parts = re.split(r"(\d+)", path.name)
        natural = [(0, int(p), "") if p.isdecimal() else (1, 0, p) for p in parts if p]
        # 1 and 01 are the same number; the name makes their order unique.
        return natural, path.name

    return tuple(sorted(paths, key=key))


def _hint(folder: Path, files: list[Path]) -> str:
    """Return what a folder without scans holds, and what to name instead."""
    inner = _folders(folder)
    sequences = [one for one in (*inner, *_inner(inner)) if _is_sequence(one)]
    if sequences:
        return f"holds {_count(len(sequences), 'sequence')}; name one: {_names(sequences)}"
    dumped: dict[str, list[Path]] = {}
    for one in inner:
        for path in one.iterdir():
            if path.is_file() and _is_scan_name(path) and not _is_note(path):
                dumped.setdefault(path.name, []).append(one)
    name = max(dumped, key=lambda key: len(dumped[key]), default="")
    if name and len(dumped[name]) > 1:
        count = len(dumped[name])
        return (
            f"no scans here, but {count} subfolders with {name}; copy or link the files into one "
            "folder, named after their subfolders"
        )
    if inner and dumped:
        scans = [one for one in inner if any(one in found for found in dumped.values())]
        return f"no scans here; name a folder that holds them: {_names(scans)}"
    captures = [path.name for path in natural_order(files) if path.suffix.lower() in _CAPTURES]
    if captures:
        return f"no scans here, but {captures[0]}, a capture; convert it to one file per scan first"
    return f"expected {LAYOUTS}, found no scan files; give a folder with scans of one format"


def _is_note(path: Path) -> bool:
    return path.suffix.lower() in _NOTE_ENDINGS and _is_pose_table(path)


_CAPTURES = {".pcap", ".pcapng", ".bag", ".mcap", ".db3"}


def _folders(folder: Path) -> tuple[Path, ...]:
    found = (one for one in folder.iterdir() if one.is_dir() and one.name[0] != ".")
    return natural_order(found)


def _inner(folders: Iterable[Path]) -> list[Path]:
    found: list[Path] = []
    for folder in folders:
        # A folder without permission to read is no sequence.
        if os.access(folder, os.R_OK | os.X_OK):
            found.extend(_folders(folder))
    return found


def _is_sequence(folder: Path) -> bool:
    places = (folder / mark for mark in _MARKS)
    return any(_is_scan_name(path) for one in places if one.is_dir() for path in one.iterdir())


def _is_scan_name(path: Path) -> bool:
    is_ford = path.suffix.lower() == ".mat"
    return path.name[0] != "." and (is_ford or format_of_name(path) is not None)


def _count(count: int, noun: str) -> str:
    return f"{count} {noun}" + ("" if count == 1 else "s")


def _names(folders: list[Path]) -> str:
    shown = ", ".join(map(str, folders[:_NAMED]))
    return shown + (", ..." if len(folders) > _NAMED else "")


def _is_pose_table(path: Path) -> bool:
    """Return whether the first rows of a text file are poses, times or edges of a graph."""
    with path.open("rb") as handle:
        lines = handle.read(_PREVIEW).decode("utf-8", "replace").split("\n")
    words = [line.split("#")[0].replace(",", " ").split() for line in lines]
    rows = [row for row in words if row]
    # The last line of the preview may be cut.
    rows = rows[:-1] if len(rows) > 1 and path.stat().st_size > _PREVIEW else rows
    try:
        # A graph names its vertices in the first column.
        numbers = [np.array(row[1:] if row[0][0].isalpha() else row, np.float64) for row in rows]
    except ValueError:
        return False
    if len(numbers) in (3, 4) and all(len(row) == 4 for row in numbers):
        return _is_rotation(np.stack(numbers)[:3, :3])
    return bool(numbers) and all(map(_is_pose_row, numbers))


def _is_pose_row(row: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> bool:
    if len(row) in (12, 13, 16):
        # KITTI, KITTI with the number of the scan, and a whole matrix.
        start = 1 if len(row) == 13 else 0
        return _is_rotation(row[start : start + 12].reshape(3, 4)[:, :3])
    if len(row) in (7, 8):
        return abs(float(np.linalg.norm(row[-4:])) - 1.0) < 1e-3
    return len(row) == 1


def _is_rotation(matrix: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> bool:
    if not np.isfinite(matrix).all() or np.abs(matrix).max() > 1.1:
        return False
    return float(np.abs(nearest_rotation(matrix) - matrix).max()) < 1e-2
