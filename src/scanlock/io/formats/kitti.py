"""What KITTI keeps beside its scans: calibration, times and clock times."""

from datetime import datetime
from pathlib import Path

import numpy as np

from scanlock.arrays import Vector
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.io.errors import malformed, read_bytes
from scanlock.io.numeric_text import parse_rows

_AGAIN = "take it from the data set again"


def read_kitti_calibration(path: Path) -> Pose:
    """Return ``camera_from_laser``, the line ``Tr:`` of an odometry sequence's calib.txt.

    Raises
    ------
    FileNotFoundError
        There is no such file.
    FormatError
        It has no such line, or one that is no rigid motion.
    """
    for line in _lines(path, "calibration"):
        name, _, numbers = line.partition(":")
        if name.strip() == "Tr":
            try:
                return Pose.from_matrix(np.array(numbers.split(), np.float64).reshape(3, 4))
            except (ValueError, InvalidInput) as error:
                raise malformed(
                    path, "Tr", expected="12 numbers of a rigid motion", found=str(error),
                    remedy=_AGAIN,
                ) from error  # fmt: skip
    raise malformed(path, "data", expected="a line Tr:", found="none", remedy=_AGAIN)


def read_kitti_times(path: Path) -> Vector:
    """Return the (n,) times [s] of an odometry sequence's times.txt, one a line.

    Raises
    ------
    FileNotFoundError
        There is no such file.
    FormatError
        A line that is no number.
    """
    columns = parse_rows(path, read_bytes(path, "time"), width=1)
    if not columns or not np.isfinite(columns[0]).all():
        raise malformed(
            path, "data", expected="a finite time a line", found="none or NaN", remedy=_AGAIN
        )
    return columns[0].astype(np.float64)


def read_clock_times(path: Path) -> Vector:
    """Return (n,) seconds since midnight of the first day, of a raw drive's timestamps.txt.

    Its lines are dates and times like ``2011-09-26 13:04:32.335337762``.

    Raises
    ------
    FileNotFoundError
        There is no such file.
    FormatError
        A line that is no date and time.
    """
    seconds: list[float] = []
    first: datetime | None = None
    for number, line in enumerate(_lines(path, "time"), start=1):
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


def _lines(path: Path, kind: str) -> list[str]:
    return read_bytes(path, kind).decode("utf-8", "replace").split("\n")
