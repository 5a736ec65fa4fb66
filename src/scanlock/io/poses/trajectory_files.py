"""Files of trajectories in KITTI and TUM format."""

import math
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from scanlock.arrays import Labels, Vector
from scanlock.errors import FormatError, InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.geometry.quaternions import pose_from_quaternion
from scanlock.geometry.rotations import quaternion_from_rotation
from scanlock.io.errors import malformed, read_bytes
from scanlock.io.numeric_text import SEPARATORS, parse_rows, without_comments
from scanlock.io.poses.pose_files import REMEDY, rigid_pose, write_rows

_MAX_NUMBER = 2**53
"""Numbers of scans are below this; larger ones have no exact double."""


def read_kitti_poses(path: str | os.PathLike[str]) -> list[Pose]:
    """Read a trajectory in KITTI format: the 12 numbers of a 3x4 matrix per line.

    Parameters
    ----------
    path : path-like
        Text file.

    Returns
    -------
    list of Pose

    Raises
    ------
    FileNotFoundError
        The file does not exist.
    FormatError
        A line that is not a pose; the message gives its number.
    """
    path = Path(path)
    return [rigid_pose(path, line, row.reshape(3, 4)) for line, row in _rows(path, 12)]


def read_numbered_poses(path: str | os.PathLike[str]) -> tuple[Labels, list[Pose]]:
    """Read a trajectory of numbered scans, as KITTI-360 has it: number and 3x4 matrix per line.

    Parameters
    ----------
    path : path-like
        Text file.

    Returns
    -------
    numbers : (n,)
        Number of each scan, from 0.
    poses : list of Pose

    Raises
    ------
    FileNotFoundError
        The file does not exist.
    FormatError
        A line that is not a number and a pose; the message gives its number.
    """
    path = Path(path)
    rows = _rows(path, 13)
    numbers = [_scan_number(path, line, row[0]) for line, row in rows]
    poses = [rigid_pose(path, line, row[1:].reshape(3, 4)) for line, row in rows]
    return np.array(numbers, np.int64), poses


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


def write_kitti_poses(path: str | os.PathLike[str], poses: Sequence[Pose]) -> None:
    """Write a trajectory in KITTI format, with 17 significant digits.

    Parameters
    ----------
    path : path-like
        Text file to write.
    poses : sequence of Pose

    Raises
    ------
    InvalidInput
        No poses.
    """
    _require_poses(poses)
    write_rows(path, np.stack([pose.matrix[:3].ravel() for pose in poses]))


def read_tum_poses(path: str | os.PathLike[str]) -> tuple[Vector, list[Pose]]:
    """Read a trajectory in TUM format: ``t x y z qx qy qz qw`` per line.

    Parameters
    ----------
    path : path-like
        Text file.

    Returns
    -------
    times : (n,) [s]
    poses : list of Pose

    Raises
    ------
    FileNotFoundError
        The file does not exist.
    FormatError
        A line that is not a time and a pose; the message gives its number.
    """
    path = Path(path)
    rows = _rows(path, 8)
    poses = [_pose_at_time(path, line, row) for line, row in rows]
    return np.array([row[0] for _, row in rows]), poses


def write_tum_poses(path: str | os.PathLike[str], times: ArrayLike, poses: Sequence[Pose]) -> None:
    """Write a trajectory in TUM format, with 17 significant digits.

    Parameters
    ----------
    path : path-like
    times : (n,) [s]
    poses : sequence of n Pose

    Raises
    ------
    InvalidInput
        No poses, or another number of finite times.
    """
    _require_poses(poses)
    stamps = np.asarray(times, dtype=np.float64)
    if stamps.shape != (len(poses),) or not np.isfinite(stamps).all():
        raise InvalidInput(
            f"times must be {len(poses)} finite numbers, one per pose, got shape {stamps.shape}"
        )
    rows = np.empty((len(poses), 8))
    rows[:, 0] = stamps
    for row, pose in zip(rows, poses, strict=True):
        row[1:4] = pose.translation
        row[[7, 4, 5, 6]] = quaternion_from_rotation(pose.rotation)
    write_rows(path, rows)


def _require_poses(poses: Sequence[Pose]) -> None:
    if len(poses) == 0:
        raise InvalidInput("poses must hold at least one pose to be written, got none")


def _rows(path: Path, width: int) -> list[tuple[str, Vector]]:
    """Return each row of a trajectory file, (width,), with its line for messages."""
    data = without_comments(read_bytes(path, "trajectory"))
    columns = parse_rows(path, data.translate(SEPARATORS), width=width)
    if not columns:
        raise malformed(
            path, "data", expected=f"lines of {width} numbers", found="none", remedy=REMEDY
        )
    rows = np.stack(columns, axis=1).astype(np.float64)
    lines = [f"line {k}" for k, text in enumerate(data.split(b"\n"), start=1) if text.strip()]
    return list(zip(lines, rows, strict=True))


def _scan_number(path: Path, line: str, number: float) -> int:
    if not (0.0 <= number < _MAX_NUMBER and float(number).is_integer()):
        raise malformed(
            path, line, expected="the number of a scan", found=f"{number:g}", remedy=REMEDY
        )
    return int(number)


def _pose_at_time(path: Path, line: str, row: Vector) -> Pose:
    """Return the pose of a row ``t x y z qx qy qz qw``."""
    time, x, y, z, qx, qy, qz, qw = row.tolist()
    try:
        if not math.isfinite(time):
            raise InvalidInput(f"a time must be finite, got {time}")
        return pose_from_quaternion((x, y, z), (qw, qx, qy, qz))
    except InvalidInput as error:
        raise malformed(
            path,
            line,
            expected="t x y z and a unit quaternion qx qy qz qw",
            found=str(error),
            remedy=REMEDY,
        ) from error
