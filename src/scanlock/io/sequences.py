"""Folders of scans that follow each other, whoever laid them out."""

import os
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from datetime import datetime
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Points, Vector, frozen
from scanlock.errors import FormatError, InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.io.faults import malformed
from scanlock.io.ford import read_ford_scan
from scanlock.io.formats import format_of_name
from scanlock.io.poses import read_kitti_poses, read_tum_poses
from scanlock.io.scans import read_scan

_LAYOUTS = """\
a folder of scan files, of KITTI (raw: velodyne_points/data; odometry: velodyne), of the Ford Campus
data set (SCANS/Scan*.mat) or of scanlock simulate (scans)"""


@dataclass(frozen=True, slots=True, eq=False)
class ScanSequence:
    """Scans in their order.

    Attributes
    ----------
    title : str
        What kind of folder it is.
    paths : tuple of Path
        One file a scan.
    times : (n,) [s]
        When each was taken; counts from zero where the folder does not tell.
    poses : tuple of Pose
        ``world_from_sensor`` of each scan as the folder has it; empty where it has none.
    load : callable
        Returns the (n, 3) points [m] of a file, without rows at (0, 0, 0).
    """

    title: str
    paths: tuple[Path, ...]
    times: Vector
    poses: tuple[Pose, ...]
    load: Callable[[Path], Points]

    def __post_init__(self) -> None:
        frozen(self.times)

    def __len__(self) -> int:
        return len(self.paths)

    @property
    def names(self) -> tuple[str, ...]:
        """What each scan is called: its file's name without the ending."""
        return tuple(path.stem for path in self.paths)

    def scan(self, index: int) -> Points:
        """Return the (n, 3) points [m] of a scan."""
        return self.load(self.paths[index])

    def taken(self, every: int, count: int | None = None) -> "ScanSequence":
        """Return every k-th scan from the first on, at most `count` of them."""
        rows = range(0, len(self), every)[:count]
        return ScanSequence(
            self.title,
            tuple(self.paths[row] for row in rows),
            self.times[rows.start : rows.stop : rows.step][: len(rows)].copy(),
            tuple(self.poses[row] for row in rows) if self.poses else (),
            self.load,
        )


def open_sequence(
    folder: str | os.PathLike[str], poses: str | os.PathLike[str] | None = None
) -> ScanSequence:
    """Return the scans of a folder in their order; nothing but names and poses is read yet.

    Parameters
    ----------
    folder : path-like
        A folder of scan files, of KITTI raw or odometry, of the Ford Campus data set, or of
        ``scanlock simulate``. KITTI raw is given no poses: its satellite track is metres off.
    poses : path-like, optional
        ``world_from_sensor`` of each scan, KITTI or TUM format, in place of the folder's own.

    Raises
    ------
    FileNotFoundError
        There is no such folder.
    FormatError
        It holds no scans, or not as many poses or times as scans.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise FileNotFoundError(2, "no such folder of scans", str(folder))
    sequence = _opened(folder)
    if poses is not None:
        sequence = _with_poses(sequence, read_trajectory(poses)[1], Path(poses))
    return sequence


def read_trajectory(path: str | os.PathLike[str]) -> tuple[Vector | None, list[Pose]]:
    """Return the times [s], where there are any, and the poses of a KITTI or TUM file."""
    path = Path(path)
    try:
        return None, read_kitti_poses(path)
    except FormatError as kitti:
        try:
            return read_tum_poses(path)
        except FormatError:
            raise kitti from None


def _opened(folder: Path) -> ScanSequence:
    for place in (folder / "SCANS", folder):
        found = _sorted(place.glob("Scan*.mat")) if place.is_dir() else ()
        if found:
            return _ford(found)
    raw = folder / "velodyne_points" / "data"
    if raw.is_dir():
        return _kitti_raw(folder, _scan_files(raw))
    if (folder / "velodyne").is_dir():
        return _kitti_odometry(folder, _scan_files(folder / "velodyne"))
    if (folder / "scans").is_dir():
        return _simulated(folder, _scan_files(folder / "scans"))
    paths = _scan_files(folder)
    return ScanSequence("folder of scans", paths, _counted(paths), (), _load)


def _ford(paths: tuple[Path, ...]) -> ScanSequence:
    heads = [read_ford_scan(path)[1:] for path in paths]
    times = np.array([time for time, _ in heads])
    return ScanSequence(
        "Ford Campus", paths, times, tuple(pose for _, pose in heads),
        lambda path: read_ford_scan(path)[0],
    )  # fmt: skip


def _kitti_raw(folder: Path, paths: tuple[Path, ...]) -> ScanSequence:
    stamps = folder / "velodyne_points" / "timestamps.txt"
    times = _counted(paths)
    if stamps.exists():
        read = _clock_times(stamps)
        # Cut copies of a drive may keep some of its scans: their names are row numbers.
        rows = [int(path.stem) if path.stem.isdecimal() else len(read) for path in paths]
        if max(rows) < len(read):
            times = read[rows]
    return ScanSequence("KITTI raw", paths, times, (), _load)


def _kitti_odometry(folder: Path, paths: tuple[Path, ...]) -> ScanSequence:
    times = _counted(paths)
    if (folder / "times.txt").exists():
        read = np.loadtxt(folder / "times.txt", ndmin=1)
        times = read if len(read) == len(paths) else times
    sequence = ScanSequence("KITTI odometry", paths, times, (), partial(_load, format="bin"))
    found = folder.parent.parent / "poses" / f"{folder.name}.txt"
    if not found.exists() or not (folder / "calib.txt").exists():
        return sequence
    # The benchmark has the poses of the left camera, and Tr carries the laser into its frame.
    camera_from_laser = _calibration(folder / "calib.txt")
    poses = [pose @ camera_from_laser for pose in read_kitti_poses(found)]
    first = camera_from_laser.inverse()
    return _with_poses(sequence, [first @ pose for pose in poses], found)


def _simulated(folder: Path, paths: tuple[Path, ...]) -> ScanSequence:
    sequence = ScanSequence("scanlock simulate", paths, _counted(paths), (), _load)
    track = folder / "poses_tum.txt"
    if not track.exists():
        return sequence
    times, poses = read_tum_poses(track)
    sequence = _with_poses(sequence, poses, track)
    return ScanSequence(sequence.title, paths, times, sequence.poses, _load)


def _with_poses(sequence: ScanSequence, poses: list[Pose], source: Path) -> ScanSequence:
    if len(poses) != len(sequence):
        raise malformed(
            source,
            "data",
            expected=f"a pose for each of the {len(sequence)} scans",
            found=f"{len(poses)}",
            remedy="name the poses of these scans, all of them and no more",
        )
    return ScanSequence(sequence.title, sequence.paths, sequence.times, tuple(poses), sequence.load)


def _scan_files(folder: Path) -> tuple[Path, ...]:
    files = (path for path in folder.iterdir() if path.is_file())
    found = _sorted(path for path in files if format_of_name(path) is not None)
    kinds = {path.suffix.lower() for path in found}
    if len(kinds) > 1:
        # A scan's points outnumber notes and poses in text beside them.
        kinds -= {".txt", ".csv", ".json"}
    found = tuple(path for path in found if path.suffix.lower() in kinds)
    if not found or len(kinds) > 1:
        what = f"files of {', '.join(sorted(kinds))}" if found else "no scan files"
        raise FormatError(
            f"{folder}: expected {_LAYOUTS}, found {what}; keep scans of one format in a folder of "
            "their own"
        )
    return found


def _sorted(paths: Iterable[Path]) -> tuple[Path, ...]:
    """Return paths in natural order: 2 before 10."""

    def key(path: Path) -> list[tuple[int, int, str]]:
        parts = re.split(r"(\d+)", path.name)
        return [(0, int(p), "") if p.isdecimal() else (1, 0, p) for p in parts if p]

    return tuple(sorted(paths, key=key))


def _load(path: Path, format: str | None = None) -> Points:
    points = read_scan(path, format).points
    is_blank = (points == 0.0).all(axis=1)
    return points[~is_blank] if is_blank.any() else points


def _counted(paths: tuple[Path, ...]) -> Vector:
    return np.arange(len(paths), dtype=np.float64)


def _clock_times(path: Path) -> NDArray[np.float64]:
    """Return seconds since midnight of the first day, of lines like 2011-09-26 13:04:32.335."""
    seconds: list[float] = []
    first: datetime | None = None
    for number, line in enumerate(path.read_text(errors="replace").split("\n"), start=1):
        if not line.strip():
            continue
        try:
            whole, _, part = line.strip().partition(".")
            moment = datetime.fromisoformat(whole)
            fraction = float(f"0.{part or 0}")
        except ValueError as error:
            raise malformed(
                path, f"line {number}", expected="a date and a time", found=repr(line[:40]),
                remedy="remove the file, and scans are numbered instead",
            ) from error  # fmt: skip
        first = first or moment.replace(hour=0, minute=0, second=0)
        seconds.append((moment - first).total_seconds() + fraction)
    return np.array(seconds)


def _calibration(path: Path) -> Pose:
    for line in path.read_text(errors="replace").split("\n"):
        name, _, numbers = line.partition(":")
        if name.strip() == "Tr":
            try:
                return Pose.from_matrix(np.array(numbers.split(), np.float64).reshape(3, 4))
            except (ValueError, InvalidInput) as error:
                raise malformed(
                    path, "Tr", expected="12 numbers of a rigid motion", found=str(error),
                    remedy="take calib.txt from the data set again",
                ) from error  # fmt: skip
    raise malformed(
        path, "data", expected="a line Tr:", found="none",
        remedy="take calib.txt from the data set again",
    )  # fmt: skip
