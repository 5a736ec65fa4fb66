"""Folders of scans that follow each other, whoever laid them out."""

import os
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from scanlock.arrays import Points, Vector, frozen
from scanlock.errors import FormatError, require_count
from scanlock.geometry.pose import Pose
from scanlock.io.errors import malformed
from scanlock.io.formats.ford import read_ford_scan
from scanlock.io.formats.kitti import read_clock_times, read_kitti_calibration, read_kitti_times
from scanlock.io.formats.registry import format_of_name
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
        require_count("every", every)
        rows = range(0, len(self), every)[:count]
        return replace(
            self,
            paths=tuple(self.paths[row] for row in rows),
            times=self.times[np.array(rows, np.int64)],
            poses=tuple(self.poses[row] for row in rows) if self.poses else (),
        )


def open_sequence(
    folder: str | os.PathLike[str],
    poses: str | os.PathLike[str] | None = None,
    *,
    every: int = 1,
    count: int | None = None,
) -> ScanSequence:
    """Return the scans of a folder in their order; no points are read yet.

    Parameters
    ----------
    folder : path-like
        A folder of scan files, of KITTI raw or odometry, of the Ford Campus data set, or of
        ``scanlock simulate``. KITTI raw is given no poses: its satellite track is decimetres off
        within seconds. The numbers in the names of KITTI's files are rows of its poses and
        times, so some of a drive's scans may be missing.
    poses : path-like, optional
        ``world_from_sensor`` of each scan, KITTI or TUM format, in place of the folder's own.
    every, count : int, optional
        Take every k-th scan, at most so many; see `ScanSequence.taken`. The Ford Campus data set
        keeps times and poses inside the scans, and those left out are not read.

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
    ford = _ford_files(folder)
    sequence = ScanSequence("Ford Campus", ford, _counted(ford), (), _load_ford) if ford else None
    sequence = sequence or _opened(folder)
    if poses is not None:
        sequence = _with_poses(sequence, read_trajectory(poses)[1], Path(poses))
    sequence = sequence.taken(every, count)
    return _with_ford_heads(sequence) if ford else sequence


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
    raw = folder / "velodyne_points" / "data"
    if raw.is_dir():
        return _kitti_raw(folder, _scan_files(raw))
    if (folder / "velodyne").is_dir():
        return _kitti_odometry(folder, _scan_files(folder / "velodyne"))
    if (folder / "scans").is_dir():
        return _simulated(folder, _scan_files(folder / "scans"))
    paths = _scan_files(folder)
    return ScanSequence("folder of scans", paths, _counted(paths), (), _load)


def _ford_files(folder: Path) -> tuple[Path, ...]:
    for place in (folder / "SCANS", folder):
        found = _sorted(place.glob("Scan*.mat")) if place.is_dir() else ()
        if found:
            return found
    return ()


def _with_ford_heads(sequence: ScanSequence) -> ScanSequence:
    heads = [read_ford_scan(path)[1:] for path in sequence.paths]
    own = tuple(pose for _, pose in heads)
    times = np.array([time for time, _ in heads])
    return replace(sequence, times=times, poses=sequence.poses or own)


def _kitti_raw(folder: Path, paths: tuple[Path, ...]) -> ScanSequence:
    stamps = folder / "velodyne_points" / "timestamps.txt"
    times = _times_of(paths, read_clock_times(stamps)) if stamps.exists() else _counted(paths)
    return ScanSequence("KITTI raw", paths, times, (), _load)


def _kitti_odometry(folder: Path, paths: tuple[Path, ...]) -> ScanSequence:
    stamps = folder / "times.txt"
    times = _times_of(paths, read_kitti_times(stamps)) if stamps.exists() else _counted(paths)
    sequence = ScanSequence("KITTI odometry", paths, times, (), partial(_load, format="bin"))
    # Of ".", only the absolute path has a name; a linked folder keeps the one it is called by.
    place = Path(os.path.abspath(folder))
    found = place.parent.parent / "poses" / f"{place.name}.txt"
    if not found.exists() or not (folder / "calib.txt").exists():
        return sequence
    # The benchmark has the poses of the left camera, and Tr carries the laser into its frame.
    camera_from_laser = read_kitti_calibration(folder / "calib.txt")
    first = camera_from_laser.inverse()
    poses = [first @ pose @ camera_from_laser for pose in read_kitti_poses(found)]
    rows = _rows_of(paths, len(poses))
    return _with_poses(sequence, poses if rows is None else [poses[row] for row in rows], found)


def _rows_of(paths: tuple[Path, ...], count: int) -> Sequence[int] | None:
    """Return which row of a drive's `count` rows each file is; None where that cannot be told."""
    if all(path.stem.isdecimal() for path in paths):
        rows = [int(path.stem) for path in paths]
        if max(rows) < count:
            return rows
    return range(count) if count == len(paths) else None


def _times_of(paths: tuple[Path, ...], read: Vector) -> Vector:
    rows = _rows_of(paths, len(read))
    return _counted(paths) if rows is None else read[np.array(rows, np.int64)]


def _simulated(folder: Path, paths: tuple[Path, ...]) -> ScanSequence:
    sequence = ScanSequence("scanlock simulate", paths, _counted(paths), (), _load)
    track = folder / "poses_tum.txt"
    if not track.exists():
        return sequence
    times, poses = read_tum_poses(track)
    sequence = _with_poses(sequence, poses, track)
    return replace(sequence, times=times)


def _with_poses(sequence: ScanSequence, poses: list[Pose], source: Path) -> ScanSequence:
    if len(poses) != len(sequence):
        raise malformed(
            source,
            "data",
            expected=f"a pose for each of the {len(sequence)} scans",
            found=f"{len(poses)}",
            remedy="name the poses of these scans, all of them and no more",
        )
    return replace(sequence, poses=tuple(poses))


def _scan_files(folder: Path) -> tuple[Path, ...]:
    # Hidden files are half-written scans, or what other systems note about the real ones.
    files = (path for path in folder.iterdir() if path.is_file() and path.name[0] != ".")
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

    def key(path: Path) -> tuple[list[tuple[int, int, str]], str]:
        parts = re.split(r"(\d+)", path.name)
        natural = [(0, int(p), "") if p.isdecimal() else (1, 0, p) for p in parts if p]
        # 1 and 01 are the same number, and folders are listed in no order.
        return natural, path.name

    return tuple(sorted(paths, key=key))


def _load(path: Path, format: str | None = None) -> Points:
    return _returns(read_scan(path, format).points)


def _load_ford(path: Path) -> Points:
    return _returns(read_ford_scan(path)[0])


def _returns(points: Points) -> Points:
    is_blank = (points == 0.0).all(axis=1)
    return points[~is_blank] if is_blank.any() else points


def _counted(paths: tuple[Path, ...]) -> Vector:
    return np.arange(len(paths), dtype=np.float64)
