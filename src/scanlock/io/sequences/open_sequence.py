"""Sequences of scans in a folder: plain files, KITTI, Ford Campus, or ``scanlock simulate``."""

import os
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from scanlock.arrays import Points, Vector
from scanlock.geometry.pose import Pose
from scanlock.io.datasets.ford import read_ford_scan
from scanlock.io.datasets.kitti import read_clock_times, read_kitti_calibration, read_kitti_times
from scanlock.io.errors import malformed
from scanlock.io.poses.trajectory_files import read_kitti_poses, read_trajectory, read_tum_poses
from scanlock.io.scans import read_scan
from scanlock.io.sequences.scan_folders import natural_order, require_folder, scan_files
from scanlock.io.sequences.scan_sequence import Loader, ScanSequence
from scanlock.io.station_files import station_paths


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
        ``scanlock simulate``; or a file of stations (E57, PTX, PTS).
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
        A file, a folder without scans, or one with another number of poses than of scans.
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
    stations = station_paths(folder) if folder.is_file() else ()
    if len(stations) < 2:
        require_folder(folder)
    ford = _ford_files(folder)
    if stations:
        sequence = _sequence("stations", stations)
    elif ford:
        sequence = _sequence("Ford Campus", ford, load=_load_ford)
    else:
        sequence = _open_other(folder)
    if poses is not None:
        sequence = _with_poses(sequence, read_trajectory(poses)[1], Path(poses))
    sequence = sequence.subsampled(every, count)
    return _with_ford_metadata(sequence) if ford else sequence


def _sequence(
    title: str,
    paths: tuple[Path, ...],
    load: Loader | None = None,
    *,
    times: Vector | None = None,
    numbers: Sequence[int] | None = None,
    missing_poses: str = "",
) -> ScanSequence:
    """Return a sequence without poses; by default files are scans, numbered from 0."""
    counted = np.array(range(len(paths)) if numbers is None else numbers, np.int64)
    return ScanSequence(
        title=title,
        paths=paths,
        times=counted.astype(np.float64) if times is None else times,
        numbers=counted,
        poses=(),
        load=load or _load,
        missing_poses=missing_poses,
    )


def _open_other(folder: Path) -> ScanSequence:
    raw = folder / "velodyne_points" / "data"
    if raw.is_dir():
        return _kitti_raw(folder, scan_files(raw))
    if (folder / "velodyne").is_dir():
        return _kitti_odometry(folder, scan_files(folder / "velodyne"))
    if (folder / "scans").is_dir():
        return _simulated(folder, scan_files(folder / "scans"))
    paths = [one for path in scan_files(folder) for one in station_paths(path)]
    return _sequence("folder of scans", tuple(paths))


def _ford_files(folder: Path) -> tuple[Path, ...]:
    for parent in (folder / "SCANS", folder):
        found = natural_order(parent.glob("Scan*.mat")) if parent.is_dir() else ()
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
    times = read_clock_times(stamps) if stamps.exists() else None
    track = " (oxts)" if (folder / "oxts").is_dir() else ""
    return _kitti_sequence(
        "KITTI raw",
        paths,
        times,
        missing_poses=(
            f"the GPS/IMU track{track} of a raw drive is off by decimetres within seconds and is "
            "not used as truth; name a file of poses"
        ),
    )


def _kitti_odometry(folder: Path, paths: tuple[Path, ...]) -> ScanSequence:
    # The absolute path names the drive even for "."; links are not resolved.
    absolute = Path(os.path.abspath(folder))
    stamps, calibration = folder / "times.txt", folder / "calib.txt"
    track = absolute.parent.parent / "poses" / f"{absolute.name}.txt"
    needed = {"calib.txt": calibration, f"../../poses/{absolute.name}.txt": track}
    missing = [name for name, path in needed.items() if not path.exists()]
    sequence = _kitti_sequence(
        "KITTI odometry",
        paths,
        read_kitti_times(stamps) if stamps.exists() else None,
        load=partial(_load, format="bin"),
        missing_poses=f"{' and '.join(missing)} missing; copy it from the data set",
    )
    if missing:
        return sequence
    # The benchmark has the poses of the left camera; Tr is camera_from_laser.
    camera_from_laser = read_kitti_calibration(calibration)
    laser_from_camera = camera_from_laser.inverse()
    poses = [laser_from_camera @ pose @ camera_from_laser for pose in read_kitti_poses(track)]
    rows = _rows_of(paths, len(poses))
    return _with_poses(sequence, poses if rows is None else [poses[row] for row in rows], track)


def _kitti_sequence(
    title: str,
    paths: tuple[Path, ...],
    times: Vector | None,
    load: Loader | None = None,
    *,
    missing_poses: str,
) -> ScanSequence:
    """Return a sequence whose files are named by their rows in the drive."""
    named = [int(path.stem) for path in paths] if _are_numbered(paths) else None
    rows = None if times is None else _rows_of(paths, len(times))
    return _sequence(
        title,
        paths,
        load,
        times=None if times is None or rows is None else times[np.array(rows, np.int64)],
        numbers=rows if named is None else named,
        missing_poses=missing_poses,
    )


def _rows_of(paths: tuple[Path, ...], count: int) -> Sequence[int] | None:
    """Return the row, of `count`, that belongs to each file; None where it is unknown."""
    if _are_numbered(paths):
        rows = [int(path.stem) for path in paths]
        if max(rows) < count:
            return rows
    return range(count) if count == len(paths) else None


def _are_numbered(paths: tuple[Path, ...]) -> bool:
    return all(path.stem.isdecimal() for path in paths)


def _simulated(folder: Path, paths: tuple[Path, ...]) -> ScanSequence:
    track = folder / "poses_tum.txt"
    sequence = _sequence(
        "scanlock simulate", paths, missing_poses="poses_tum.txt missing; name a file of poses"
    )
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
    return replace(sequence, poses=tuple(poses), missing_poses="")


def _load(path: Path, format: str | None = None) -> Points:
    return _returns(read_scan(path, format).points)


def _load_ford(path: Path) -> Points:
    return _returns(read_ford_scan(path)[0])


def _returns(points: Points) -> Points:
    """Return the points without rows at (0, 0, 0), which sensors write for lost returns."""
    is_zero = (points == 0.0).all(axis=1)
    return points[~is_zero] if is_zero.any() else points
