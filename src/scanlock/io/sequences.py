"""Sequences of scans in a folder: plain files, KITTI, Ford Campus, or ``scanlock simulate``."""

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
from scanlock.io.datasets.ford import read_ford_scan
from scanlock.io.datasets.kitti import read_clock_times, read_kitti_calibration, read_kitti_times
from scanlock.io.errors import malformed
from scanlock.io.formats.registry import format_of_name
from scanlock.io.poses import read_kitti_poses, read_tum_poses
from scanlock.io.scans import read_scan

_LAYOUTS = """\
a folder of scan files, of KITTI (raw: velodyne_points/data; odometry: velodyne), of the Ford Campus
data set (SCANS/Scan*.mat) or of scanlock simulate (scans)"""
"""The supported layouts, for messages."""


_Loader = Callable[[Path], Points]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class ScanSequence:
    """Scan files in temporal order, with times and poses; points are read on request.

    Attributes
    ----------
    title : str
        Kind of the folder.
    paths : tuple of Path
        File of each scan.
    times : (n,) [s]
        Time of each scan; 0, 1, 2, ... where the folder has no times.
    poses : tuple of Pose
        ``world_from_sensor`` of each scan; empty where the folder has no poses.
    load : callable
        Function that returns the (n, 3) points [m] of a file, without rows at (0, 0, 0).
    """

    title: str
    paths: tuple[Path, ...]
    times: Vector
    poses: tuple[Pose, ...]
    load: _Loader

    def __post_init__(self) -> None:
        frozen(self.times)

    def __len__(self) -> int:
        return len(self.paths)

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each scan: that of its file without the extension."""
        return tuple(path.stem for path in self.paths)

    def scan(self, index: int) -> Points:
        """Read the (n, 3) points [m] of a scan."""
        return self.load(self.paths[index])

    def subsampled(self, every: int, count: int | None = None) -> "ScanSequence":
        """Return every k-th scan from the first on, at most `count` of them.

        Raises
        ------
        InvalidInput
            An `every` below one.
        """
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
    """Open a folder of scans as a sequence, without reading points.

    Parameters
    ----------
    folder : path-like
        A folder of scan files, of KITTI raw or odometry, of the Ford Campus data set, or of
        ``scanlock simulate``.
    poses : path-like, optional
        File of ``world_from_sensor`` of each scan, in KITTI or TUM format, instead of the poses
        of the folder.
    every, count : int, optional
        Take every k-th scan, and at most `count`; see `ScanSequence.subsampled`.

    Returns
    -------
    ScanSequence

    Raises
    ------
    FileNotFoundError
        The folder does not exist.
    FormatError
        A folder without scans, or with another number of poses than of scans.
    InvalidInput
        An `every` below one.

    Notes
    -----
    KITTI names its files by row of its poses and times, so some scans of a drive may be missing.
    KITTI raw has no poses here: its GPS/IMU track is off by decimetres within seconds. The Ford
    Campus data set stores times and poses inside the scans; only those of the scans taken are
    read.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise FileNotFoundError(2, "no such folder of scans", str(folder))
    ford = _ford_files(folder)
    sequence = _sequence("Ford Campus", ford, load=_load_ford) if ford else _open_other(folder)
    if poses is not None:
        sequence = _with_poses(sequence, read_trajectory(poses)[1], Path(poses))
    sequence = sequence.subsampled(every, count)
    return _with_ford_metadata(sequence) if ford else sequence


def read_trajectory(path: str | os.PathLike[str]) -> tuple[Vector | None, list[Pose]]:
    """Read a trajectory in KITTI or TUM format.

    Parameters
    ----------
    path : path-like
        Text file.

    Returns
    -------
    times : (n,) [s] or None
        None for KITTI, whose files have no times.
    poses : list of Pose

    Raises
    ------
    FileNotFoundError
        The file does not exist.
    FormatError
        A file in neither format.
    """
    path = Path(path)
    try:
        return None, read_kitti_poses(path)
    except FormatError as kitti:
        try:
            return read_tum_poses(path)
        except FormatError:
            raise kitti from None


def _sequence(
    title: str, paths: tuple[Path, ...], times: Vector | None = None, load: _Loader | None = None
) -> ScanSequence:
    """Return a sequence without poses; times are row numbers, and files are scans, by default."""
    return ScanSequence(
        title=title,
        paths=paths,
        times=np.arange(len(paths), dtype=np.float64) if times is None else times,
        poses=(),
        load=load or _load,
    )


def _open_other(folder: Path) -> ScanSequence:
    raw = folder / "velodyne_points" / "data"
    if raw.is_dir():
        return _kitti_raw(folder, _scan_files(raw))
    if (folder / "velodyne").is_dir():
        return _kitti_odometry(folder, _scan_files(folder / "velodyne"))
    if (folder / "scans").is_dir():
        return _simulated(folder, _scan_files(folder / "scans"))
    return _sequence("folder of scans", _scan_files(folder))


def _ford_files(folder: Path) -> tuple[Path, ...]:
    for parent in (folder / "SCANS", folder):
        found = _sorted(parent.glob("Scan*.mat")) if parent.is_dir() else ()
        if found:
            return found
    return ()


def _with_ford_metadata(sequence: ScanSequence) -> ScanSequence:
    """Return the sequence with the times and, unless others are given, the poses of its files."""
    metadata = [read_ford_scan(path)[1:] for path in sequence.paths]
    poses = tuple(pose for _, pose in metadata)
    times = np.array([time for time, _ in metadata])
    return replace(sequence, times=times, poses=sequence.poses or poses)


def _kitti_raw(folder: Path, paths: tuple[Path, ...]) -> ScanSequence:
    stamps = folder / "velodyne_points" / "timestamps.txt"
    times = _times_of(paths, read_clock_times(stamps)) if stamps.exists() else None
    return _sequence("KITTI raw", paths, times)


def _kitti_odometry(folder: Path, paths: tuple[Path, ...]) -> ScanSequence:
    stamps = folder / "times.txt"
    times = _times_of(paths, read_kitti_times(stamps)) if stamps.exists() else None
    sequence = _sequence("KITTI odometry", paths, times, load=partial(_load, format="bin"))
    # The absolute path names the drive even for "."; links are not resolved.
    absolute = Path(os.path.abspath(folder))
    track = absolute.parent.parent / "poses" / f"{absolute.name}.txt"
    if not track.exists() or not (folder / "calib.txt").exists():
        return sequence
    # The benchmark has the poses of the left camera; Tr is camera_from_laser.
    camera_from_laser = read_kitti_calibration(folder / "calib.txt")
    laser_from_camera = camera_from_laser.inverse()
    poses = [laser_from_camera @ pose @ camera_from_laser for pose in read_kitti_poses(track)]
    rows = _rows_of(paths, len(poses))
    return _with_poses(sequence, poses if rows is None else [poses[row] for row in rows], track)


def _rows_of(paths: tuple[Path, ...], count: int) -> Sequence[int] | None:
    """Return the row, of `count`, that belongs to each file; None where it is unknown."""
    if all(path.stem.isdecimal() for path in paths):
        rows = [int(path.stem) for path in paths]
        if max(rows) < count:
            return rows
    return range(count) if count == len(paths) else None


def _times_of(paths: tuple[Path, ...], times: Vector) -> Vector | None:
    """Return the time of each file among the times of a drive; None where it is unknown."""
    rows = _rows_of(paths, len(times))
    return None if rows is None else times[np.array(rows, np.int64)]


def _simulated(folder: Path, paths: tuple[Path, ...]) -> ScanSequence:
    sequence = _sequence("scanlock simulate", paths)
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
            remedy="give one pose for each of these scans",
        )
    return replace(sequence, poses=tuple(poses))


def _scan_files(folder: Path) -> tuple[Path, ...]:
    # Hidden files are incomplete scans, or metadata of other systems.
    files = (path for path in folder.iterdir() if path.is_file() and path.name[0] != ".")
    found = _sorted(path for path in files if format_of_name(path) is not None)
    extensions = {path.suffix.lower() for path in found}
    if len(extensions) > 1:
        # Text files beside scans of another format are notes and poses.
        extensions -= {".txt", ".csv", ".json"}
    found = tuple(path for path in found if path.suffix.lower() in extensions)
    if not found or len(extensions) > 1:
        content = f"files of {', '.join(sorted(extensions))}" if found else "no scan files"
        raise FormatError(
            f"{folder}: expected {_LAYOUTS}, found {content}; give a folder with the scans of one "
            "format only"
        )
    return found


def _sorted(paths: Iterable[Path]) -> tuple[Path, ...]:
    """Return paths in natural order: 2 before 10."""

    def key(path: Path) -> tuple[list[tuple[int, int, str]], str]:
        parts = re.split(r"(\d+)", path.name)
        natural = [(0, int(p), "") if p.isdecimal() else (1, 0, p) for p in parts if p]
        # 1 and 01 are the same number; the name makes their order unique.
        return natural, path.name

    return tuple(sorted(paths, key=key))


def _load(path: Path, format: str | None = None) -> Points:
    return _returns(read_scan(path, format).points)


def _load_ford(path: Path) -> Points:
    return _returns(read_ford_scan(path)[0])


def _returns(points: Points) -> Points:
    """Return the points without rows at (0, 0, 0), which sensors write for lost returns."""
    is_zero = (points == 0.0).all(axis=1)
    return points[~is_zero] if is_zero.any() else points
