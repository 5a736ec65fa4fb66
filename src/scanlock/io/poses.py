"""Poses and trajectories as files: plain matrices, JSON, KITTI and TUM."""

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scanlock.arrays import Matrix, Vector
from scanlock.errors import FormatError, InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import quaternion_from_rotation
from scanlock.io.atomic import atomic_file
from scanlock.io.errors import malformed, read_bytes
from scanlock.io.formats.npy import array_from_npy
from scanlock.io.numeric_text import SEPARATORS, parse_rows, without_comments
from scanlock.io.quaternions import pose_from_quaternion

_KEY = "target_from_source"
_BRACKETS = bytes.maketrans(b"[]()", b"    ")
_EXPECTED = "a 4x4 or 3x4 matrix, or its 16 or 12 numbers"
_REMEDY = "check that it is the right file and complete"


def read_pose(path: str | os.PathLike[str]) -> Pose:
    """Return the pose in a text, JSON or .npy file; a rotation with few digits is mended.

    Parameters
    ----------
    path : path-like
        A 4x4 or 3x4 matrix, or its 16 or 12 numbers row by row, in text (spaces, commas and
        brackets allowed, comments after ``#``), as a JSON list or under the JSON key
        ``target_from_source``, or as a NumPy array.

    Raises
    ------
    FileNotFoundError
        There is no such file.
    FormatError
        Anything but one rigid motion; names the line where there is one to blame.
    """
    path = Path(path)
    return _rigid(path, *_given(path))


def read_pose_matrix(path: str | os.PathLike[str]) -> Matrix:
    """Return the (4, 4) matrix in a file that `read_pose` takes, with its rotation as it stands.

    For callers that tell how far it was from a rotation, such as `scanlock.register`.
    """
    path = Path(path)
    where, rows = _given(path)
    matrix = _rigid(path, where, rows).matrix
    matrix[:3, :3] = rows[:3, :3]
    return matrix


def write_pose(path: str | os.PathLike[str], pose: Pose) -> None:
    """Write the 4x4 matrix as text, 17 significant digits a number, so that nothing is lost."""
    _write_rows(path, pose.matrix)


def read_kitti_poses(path: str | os.PathLike[str]) -> list[Pose]:
    """Return the poses of a trajectory with the 12 numbers of a 3x4 matrix a line.

    Raises
    ------
    FileNotFoundError
        There is no such file.
    FormatError
        A line that is no pose, by its number.
    """
    path = Path(path)
    lines, rows = _rows(path, 12)
    return [_pose(path, f"line {line}", row) for line, row in zip(lines, rows, strict=True)]


def write_kitti_poses(path: str | os.PathLike[str], poses: Sequence[Pose]) -> None:
    """Write the 12 numbers of the 3x4 matrix of each pose, one a line, 17 significant digits."""
    _require_poses(poses)
    _write_rows(path, np.stack([pose.matrix[:3].ravel() for pose in poses]))


def read_tum_poses(path: str | os.PathLike[str]) -> tuple[Vector, list[Pose]]:
    """Return the times [s] and poses of a trajectory in lines ``t x y z qx qy qz qw``.

    Raises
    ------
    FileNotFoundError
        There is no such file.
    FormatError
        A line that is no stamped pose, by its number.
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
                remedy=_REMEDY,
            ) from error
    return np.ascontiguousarray(rows[:, 0]), poses


def write_tum_poses(path: str | os.PathLike[str], times: ArrayLike, poses: Sequence[Pose]) -> None:
    """Write a line ``t x y z qx qy qz qw`` a pose, 17 significant digits a number; times in s."""
    _require_poses(poses)
    stamps = np.asarray(times, dtype=np.float64)
    if stamps.shape != (len(poses),) or not np.isfinite(stamps).all():
        raise InvalidInput(
            f"times must be {len(poses)} finite numbers, one a pose, got shape {stamps.shape}"
        )
    rows = np.empty((len(poses), 8))
    rows[:, 0] = stamps
    for row, pose in zip(rows, poses, strict=True):
        row[1:4] = pose.translation
        row[[7, 4, 5, 6]] = quaternion_from_rotation(pose.rotation)
    _write_rows(path, rows)


def _write_rows(path: str | os.PathLike[str], rows: Matrix) -> None:
    lines = (" ".join(f"{value:.17g}" for value in row) for row in rows.tolist())
    with atomic_file(path) as handle:
        handle.write(("\n".join(lines) + "\n").encode("ascii"))


def _require_poses(poses: Sequence[Pose]) -> None:
    if len(poses) == 0:
        raise InvalidInput("poses must hold at least one pose to be written, got none")


def _columns(path: Path, data: bytes, width: int | None) -> list[NDArray[Any]]:
    return parse_rows(path, without_comments(data).translate(SEPARATORS), width=width)


def _rows(path: Path, width: int) -> tuple[list[int], Matrix]:
    """Return the line numbers and the (n, width) numbers of a trajectory file."""
    data = read_bytes(path, "trajectory")
    columns = _columns(path, data, width)
    if not columns:
        raise malformed(
            path, "data", expected=f"lines of {width} numbers", found="none", remedy=_REMEDY
        )
    texts = without_comments(data).split(b"\n")
    lines = [number for number, text in enumerate(texts, start=1) if text.strip()]
    return lines, np.stack(columns, axis=1).astype(np.float64)


def _given(path: Path) -> tuple[str, Matrix]:
    """Return the rows of the matrix in a pose file, after what of the file they are."""
    data = read_bytes(path, "pose")
    if data.startswith(b"\x93NUMPY"):
        return "array", _matrix_rows(path, "array", array_from_npy(path, data))
    start = data.lstrip()[:1]
    if path.suffix.lower() == ".json" or start == b"{":
        return "JSON", _matrix_rows(path, "JSON", _json_numbers(path, data))
    if start == b"[":
        # NumPy prints brackets too, without the commas that JSON wants.
        try:
            return "JSON", _matrix_rows(path, "JSON", _json_numbers(path, data))
        except FormatError:
            data = data.translate(_BRACKETS)
    columns = _columns(path, data.translate(_BRACKETS), None)
    numbers = np.stack(columns, axis=1) if columns else np.empty(0)
    return "text", _matrix_rows(path, "text", numbers)


def _json_numbers(path: Path, data: bytes) -> Any:
    try:
        content: Any = json.loads(data)
    except json.JSONDecodeError as error:
        raise malformed(
            path, f"line {error.lineno}", expected="JSON", found=error.msg, remedy=_REMEDY
        ) from error
    except (ValueError, RecursionError) as error:
        # Not UTF-8, a number of thousands of digits, or thousands of brackets.
        raise malformed(
            path, "JSON", expected="a matrix in UTF-8", found=str(error), remedy=_REMEDY
        ) from error
    if isinstance(content, dict):
        if _KEY not in content:
            raise malformed(
                path,
                "JSON",
                expected=f"the key {_KEY}",
                found=", ".join(map(str, content))[:80] or "no keys",
                remedy=f"name the matrix {_KEY}, or keep nothing but the list of lists",
            )
        return content[_KEY]
    return content


def _pose(path: Path, where: str, numbers: Any) -> Pose:
    """Return the pose of 12 or 16 numbers in any of their shapes."""
    return _rigid(path, where, _matrix_rows(path, where, numbers))


def _matrix_rows(path: Path, where: str, numbers: Any) -> Matrix:
    """Return 12 or 16 numbers in any of their shapes as rows of four."""
    try:
        matrix = np.asarray(numbers, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise malformed(
            path, where, expected=_EXPECTED, found=f"other content ({error})", remedy=_REMEDY
        ) from error
    if matrix.shape not in ((4, 4), (3, 4), (12,), (1, 12), (12, 1), (16,), (1, 16), (16, 1)):
        raise malformed(
            path,
            where,
            expected=_EXPECTED,
            found=f"numbers of shape {matrix.shape}",
            remedy="of a trajectory, save the one pose that is meant",
        )
    return matrix.reshape(-1, 4)


def _rigid(path: Path, where: str, matrix: Matrix) -> Pose:
    try:
        return Pose.from_matrix(matrix)
    except InvalidInput as error:
        transposed = matrix.shape == (4, 4) and np.array_equal(matrix[:, 3], (0, 0, 0, 1))
        raise malformed(
            path,
            where,
            expected="a rotation and a translation",
            found=str(error),
            remedy="it looks transposed: store it row by row" if transposed else _REMEDY,
        ) from error
