"""Files of one pose: a matrix as text, JSON or NumPy array."""

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Matrix
from scanlock.errors import FormatError, InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.io.atomic import atomic_file
from scanlock.io.errors import malformed, read_bytes
from scanlock.io.formats.npy import array_from_npy
from scanlock.io.numeric_text import SEPARATORS, parse_rows, without_comments

_KEY = "target_from_source"
_BRACKETS = bytes.maketrans(b"[]()", b"    ")
_EXPECTED = "a 4x4 or 3x4 matrix, or its 16 or 12 numbers"
REMEDY = "check that it is the right file and complete"


def read_pose(path: str | os.PathLike[str]) -> Pose:
    """Read a pose from a text, JSON or .npy file.

    A rotation printed with few digits is replaced by the nearest exact one.

    Parameters
    ----------
    path : path-like
        A 4x4 or 3x4 matrix, or its 16 or 12 numbers row by row: as text (with spaces, commas,
        brackets, and comments after ``#``), as a JSON list, under the JSON key
        ``target_from_source``, or as a NumPy array.

    Returns
    -------
    Pose
        As the file has it; target from source in results of `scanlock.register`.

    Raises
    ------
    FileNotFoundError
        The file does not exist.
    FormatError
        Any other content; the message gives the line, where there is one.
    """
    path = Path(path)
    return rigid_pose(path, *_located_rows(path))


def read_pose_matrix(path: str | os.PathLike[str]) -> Matrix:
    """Read the matrix of a pose file with its rotation uncorrected.

    For callers that report the correction, such as `scanlock.register`.

    Parameters
    ----------
    path : path-like
        As for `read_pose`.

    Returns
    -------
    (4, 4)

    Raises
    ------
    FileNotFoundError, FormatError
        As for `read_pose`.
    """
    path = Path(path)
    where, rows = _located_rows(path)
    matrix = rigid_pose(path, where, rows).matrix
    matrix[:3, :3] = rows[:3, :3]
    return matrix


def write_pose(path: str | os.PathLike[str], pose: Pose, comment: str = "") -> None:
    """Write the 4x4 matrix of a pose as text, with 17 significant digits, which lose nothing.

    Parameters
    ----------
    path : path-like
        Text file to write.
    pose : Pose
    comment : str
        Text for a first line after ``#``, which `read_pose` ignores; in one line.
    """
    write_rows(path, pose.matrix, comment)


def read_pose_comment(path: str | os.PathLike[str]) -> str:
    """Return the comment of a pose file in text, or the status of one in JSON; empty without.

    Files of `scanlock register` state there that a pose is not verified.
    """
    data = read_bytes(Path(path), "pose")
    if data.startswith(b"#"):
        return data.splitlines()[0][1:].decode("utf-8", "replace").strip()
    if not data.lstrip().startswith(b"{"):
        return ""
    try:
        content = json.loads(data)
    except ValueError:
        return ""
    status = content.get("status", "ok")
    return "" if status == "ok" else f"not verified: {status}; {content.get('reason', '')}"


def write_rows(path: str | os.PathLike[str], rows: Matrix, comment: str = "") -> None:
    """Write rows of numbers with 17 significant digits, and a comment in the first line."""
    lines = [" ".join(f"{value:.17g}" for value in row) for row in rows.tolist()]
    if comment:
        lines.insert(0, "# " + " ".join(comment.split()))
    with atomic_file(path) as handle:
        handle.write(("\n".join(lines) + "\n").encode())


def _columns(path: Path, data: bytes, width: int | None) -> list[NDArray[Any]]:
    return parse_rows(path, without_comments(data).translate(SEPARATORS), width=width)


def _located_rows(path: Path) -> tuple[str, Matrix]:
    """Return the location of the matrix in a pose file, for messages, and its rows."""
    data = read_bytes(path, "pose")
    if data.startswith(b"\x93NUMPY"):
        return "array", _matrix_rows(path, "array", array_from_npy(path, data))
    start = data.lstrip()[:1]
    if path.suffix.lower() == ".json" or start == b"{":
        return "JSON", _matrix_rows(path, "JSON", _json_numbers(path, data))
    if start == b"[":
        # NumPy prints brackets too, but without the commas of JSON.
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
            path, f"line {error.lineno}", expected="JSON", found=error.msg, remedy=REMEDY
        ) from error
    except (ValueError, RecursionError) as error:
        # Not UTF-8, or a number of thousands of digits, or thousands of brackets.
        raise malformed(
            path, "JSON", expected="a matrix in UTF-8", found=str(error), remedy=REMEDY
        ) from error
    if isinstance(content, dict):
        if _KEY not in content:
            raise malformed(
                path,
                "JSON",
                expected=f"the key {_KEY}",
                found=", ".join(map(str, content))[:80] or "no keys",
                remedy=f"store the matrix under {_KEY}, or store only the list of lists",
            )
        return content[_KEY]
    return content


def _matrix_rows(path: Path, where: str, numbers: Any) -> Matrix:
    """Return 12 or 16 numbers, flat or as a matrix, as rows of four."""
    try:
        matrix = np.asarray(numbers, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise malformed(
            path, where, expected=_EXPECTED, found=f"other content ({error})", remedy=REMEDY
        ) from error
    if matrix.shape not in ((4, 4), (3, 4), (12,), (1, 12), (12, 1), (16,), (1, 16), (16, 1)):
        raise malformed(
            path,
            where,
            expected=_EXPECTED,
            found=f"numbers of shape {matrix.shape}",
            remedy="save one pose only, if this is a trajectory",
        )
    return matrix.reshape(-1, 4)


def rigid_pose(path: Path, where: str, matrix: Matrix) -> Pose:
    """Return the pose of a (3, 4) or (4, 4) matrix; raise `FormatError` if it is not rigid."""
    try:
        return Pose.from_matrix(matrix)
    except InvalidInput as error:
        transposed = matrix.shape == (4, 4) and np.array_equal(matrix[:, 3], (0, 0, 0, 1))
        raise malformed(
            path,
            where,
            expected="a rotation and a translation",
            found=str(error),
            remedy="it looks transposed: store it row by row" if transposed else REMEDY,
        ) from error
