"""Files of trajectories in KITTI and TUM format."""

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from scanlock.arrays import Labels, Matrix, Vector
from scanlock.errors import FormatError, InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.geometry.quaternions import pose_from_quaternion
from scanlock.geometry.rotations import quaternion_from_rotation
from scanlock.io.errors import malformed, read_bytes
from scanlock.io.numeric_text import SEPARATORS, parse_rows, without_comments
from scanlock.io.poses.pose_files import REMEDY, rigid_pose, write_rows


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
    lines, rows = _rows(path, 12)
    return [
        rigid_pose(path, f"line {line}", row.reshape(3, 4))
        for line, row in zip(lines, rows, strict=True)
    ]


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
    lines, rows = _rows(path, 13)
    for line, number in zip(lines, rows[:, 0].tolist(), strict=True):
        if not (number >= 0.0 and number.is_integer()):
            raise malformed(
                path, f"line {line}", expected="the number of a scan", found=f"{number:g}",
                remedy=REMEDY,
            )  # fmt: skip
    poses = [
        rigid_pose(path, f"line {line}", row[1:].reshape(3, 4))
        for line, row in zip(lines, rows, strict=True)
    ]
    return rows[:, 0].astype(np.int64), poses


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
    lines, rows = _rows(path, 8)
    poses: list[Pose] = []
    for line, row in zip(lines, rows, strict=True):
        try:
            if not np.isfinite(row[0]):
                raise InvalidInput(f"a time must be finite, got {row[0]}")
            poses.append(pose_from_quaternion(row[1:4].tolist(), row[[7, 4, 5, 6]].tolist()))
        except InvalidInput as error:
            raise malformed(
                path,
                f"line {line}",
                expected="t x y z and a unit quaternion qx qy qz qw",
                found=str(error),
                remedy=REMEDY,
            ) from error
    return np.ascontiguousarray(rows[:, 0]), poses


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


def _rows(path: Path, width: int) -> tuple[list[int], Matrix]:
    """Return the line numbers and the (n, width) values of a trajectory file."""
    data = read_bytes(path, "trajectory")
    columns = parse_rows(path, without_comments(data).translate(SEPARATORS), width=width)
    if not columns:
        raise malformed(
            path, "data", expected=f"lines of {width} numbers", found="none", remedy=REMEDY
        )
    texts = without_comments(data).split(b"\n")
    lines = [number for number, text in enumerate(texts, start=1) if text.strip()]
    return lines, np.stack(columns, axis=1).astype(np.float64)
