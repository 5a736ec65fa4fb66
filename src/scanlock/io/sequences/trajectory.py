"""Trajectories with the times and scan numbers of their rows, from files or folders of scans."""

import csv
import io
import os
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from scanlock.arrays import Labels, Vector
from scanlock.errors import FormatError
from scanlock.geometry.pose import Pose
from scanlock.io.atomic import atomic_file
from scanlock.io.datasets.kitti import read_kitti_calibration, read_kitti_times
from scanlock.io.errors import malformed
from scanlock.io.poses.trajectory_files import read_numbered_poses, read_trajectory
from scanlock.io.sequences.open_sequence import open_sequence
from scanlock.io.sequences.scan_sequence import ScanSequence

SCAN_TABLE = "scans.csv"
"""Name of the file with number, name and time of each row, in the folder of a trajectory."""

_HEADS = ("number", "name", "time")


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Trajectory:
    """Poses with times and scan numbers, as far as they are known.

    Attributes
    ----------
    path : Path
        File or folder of the poses.
    poses : list of n Pose
        ``world_from_sensor``.
    times : (n,) [s] or None
        Time of each pose.
    numbers : (n,) or None
        Number of each scan: its row in the data set, or in the folder of all scans.
    names : tuple of n str or None
        Name of each scan.
    camera_from_laser : Pose or None
        Calibration of a KITTI odometry sequence, whose files of poses are those of the camera.
    """

    path: Path
    poses: list[Pose]
    times: Vector | None = None
    numbers: Labels | None = None
    names: tuple[str, ...] | None = None
    camera_from_laser: Pose | None = None

    def __len__(self) -> int:
        return len(self.poses)


def open_trajectory(path: str | os.PathLike[str]) -> Trajectory:
    """Read a trajectory with all that its surroundings tell about its rows.

    Parameters
    ----------
    path : path-like
        A file in KITTI or TUM format, in KITTI format with the number of the scan before each row
        as in KITTI-360, or a folder of scans with poses. Beside a KITTI or TUM file these are
        used, each only with a row for each pose: ``scans.csv`` of ``scanlock map``, ``times.txt``,
        and for ``poses/NN.txt`` of KITTI ``../sequences/NN/times.txt``; ``calib.txt`` there gives
        the calibration.

    Returns
    -------
    Trajectory

    Raises
    ------
    FileNotFoundError
        The file does not exist.
    FormatError
        A file in neither format, or a folder without poses.
    """
    path = Path(path)
    if path.is_dir():
        return _of_folder(path, open_sequence(path))
    found = _of_file(path)
    if found.numbers is not None:
        return found
    table = path.parent / SCAN_TABLE
    if table.exists():
        return _with_scans(found, _read_scan_table(table))
    # The absolute path names the folders even for a bare file name; links are not resolved.
    absolute = Path(os.path.abspath(path))
    sequence = absolute.parent.parent / "sequences" / absolute.stem
    calibration = sequence / "calib.txt"
    if absolute.parent.name == "poses" and calibration.exists():
        found = replace(found, camera_from_laser=read_kitti_calibration(calibration))
    for stamps in (absolute.parent / "times.txt", sequence / "times.txt"):
        if found.times is None and stamps.exists():
            found = _with_times(found, read_kitti_times(stamps))
    return found


def write_scan_table(path: str | os.PathLike[str], sequence: ScanSequence, count: int) -> None:
    """Write number, name and time of the first `count` scans of a sequence as CSV.

    `open_trajectory` reads it beside a trajectory and matches rows by it.

    Parameters
    ----------
    path : path-like
        File to write.
    sequence : ScanSequence
    count : int
        Number of scans.
    """
    text = io.StringIO()
    rows = zip(sequence.numbers, sequence.names, sequence.times, strict=True)
    table = csv.writer(text, lineterminator="\n")
    table.writerow(_HEADS)
    for number, name, time in list(rows)[:count]:
        table.writerow((int(number), name, repr(float(time))))
    with atomic_file(path) as handle:
        handle.write(text.getvalue().encode())


def _of_file(path: Path) -> Trajectory:
    try:
        times, poses = read_trajectory(path)
    except FormatError as error:
        try:
            numbers, poses = read_numbered_poses(path)
        except FormatError:
            raise error from None
        return Trajectory(path=path, poses=poses, numbers=numbers)
    return Trajectory(path=path, poses=poses, times=times)


def _of_folder(path: Path, sequence: ScanSequence) -> Trajectory:
    if not sequence.poses:
        reason = sequence.missing_poses or "name a file of poses"
        raise FormatError(
            f"{path}: expected a folder of scans with their poses, found none "
            f"({sequence.title}): {reason}"
        )
    found = Trajectory(path=path, poses=list(sequence.poses))
    calibration = path / "calib.txt"
    if (path / "velodyne").is_dir() and calibration.exists():
        found = replace(found, camera_from_laser=read_kitti_calibration(calibration))
    scans = _ScanTable(sequence.numbers, sequence.names, sequence.times)
    return _with_scans(found, scans)


@dataclass(frozen=True, slots=True, eq=False)
class _ScanTable:
    numbers: Labels
    names: tuple[str, ...]
    times: Vector


def _with_scans(found: Trajectory, scans: _ScanTable) -> Trajectory:
    """Return the trajectory with numbers, names and times; times that count scans are none."""
    count = len(found)
    # A kill may leave the table one scan ahead of the poses, which are written after it.
    if len(scans.numbers) not in (count, count + 1):
        return found
    numbers, times = scans.numbers[:count], scans.times[:count]
    counted = np.array_equal(times, numbers)
    return replace(
        found, numbers=numbers, names=scans.names[:count], times=None if counted else times
    )


def _with_times(found: Trajectory, times: Vector) -> Trajectory:
    return replace(found, times=times) if len(times) == len(found) else found


def _read_scan_table(path: Path) -> _ScanTable:
    with path.open(newline="", encoding="utf-8") as handle:
        rows = list(csv.DictReader(handle))
    try:
        numbers = np.array([int(row["number"]) for row in rows], np.int64)
        times = np.array([float(row["time"]) for row in rows], np.float64)
        names = tuple(row["name"] for row in rows)
    except (KeyError, TypeError, ValueError) as error:
        raise malformed(
            path, "data", expected="columns number, name and time", found=str(error),
            remedy="map the scans again, or remove this file",
        ) from error  # fmt: skip
    return _ScanTable(numbers, names, times)
