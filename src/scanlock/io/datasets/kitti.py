"""Calibration and times of KITTI sequences."""

from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from scanlock.arrays import Vector
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.io.errors import malformed, read_bytes
from scanlock.io.numeric_text import parse_rows

_REMEDY = "copy the file from the data set again"


def read_kitti_calibration(path: Path) -> Pose:
    """Read ``camera_from_laser``, the line ``Tr:`` in calib.txt of an odometry sequence.

    Raises
    ------
    FileNotFoundError
        The file does not exist.
    FormatError
        No such line, or one that is not a rigid motion.
    """
    for line in _lines(path, "calibration"):
        name, _, numbers = line.partition(":")
        if name.strip() == "Tr":
            try:
                return Pose.from_matrix(np.array(numbers.split(), np.float64).reshape(3, 4))
            except (ValueError, InvalidInput) as error:
                raise malformed(
                    path, "Tr", expected="12 numbers of a rigid motion", found=str(error),
                    remedy=_REMEDY,
                ) from error  # fmt: skip
    raise malformed(path, "data", expected="a line Tr:", found="none", remedy=_REMEDY)


def read_kitti_times(path: Path) -> Vector:
    """Read the (n,) times [s] in times.txt of an odometry sequence, one per line.

    Raises
    ------
    FileNotFoundError
        The file does not exist.
    FormatError
        A line that is not a finite number.
    """
    columns = parse_rows(path, read_bytes(path, "time"), width=1)
    if not columns or not np.isfinite(columns[0]).all():
        raise malformed(
            path, "data", expected="a finite time per line", found="none or NaN", remedy=_REMEDY
        )
    return columns[0].astype(np.float64)


def read_clock_times(path: Path) -> Vector:
    """Read timestamps.txt of a raw drive, of the laser or of oxts, as (n,) UNIX times [s].

    Its lines are dates and times such as ``2011-09-26 13:04:32.335337762``, the local time of
    Karlsruhe without a time zone. They are read as if they were UTC, whatever the time zone of
    this machine, so that all times of the data set agree with each other; real UNIX times are two
    hours earlier (CEST). As float64 they are exact to 0.2 us.

    Raises
    ------
    FileNotFoundError
        The file does not exist.
    FormatError
        A line that is not a date and time.
    """
    seconds: list[float] = []
    for number, line in enumerate(_lines(path, "time"), start=1):
        if not line.strip():
            continue
        try:
            whole, _, part = line.strip().partition(".")
            moment = datetime.fromisoformat(whole).replace(tzinfo=UTC)
            fraction = float(f"0.{part or 0}")
        except ValueError as error:
            raise malformed(
                path, f"line {number}", expected="a date and a time", found=repr(line[:40]),
                remedy="copy the file again, or remove it to number the scans instead",
            ) from error  # fmt: skip
        seconds.append(moment.timestamp() + fraction)
    return np.array(seconds)


def _lines(path: Path, kind: str) -> list[str]:
    return read_bytes(path, kind).decode("utf-8", "replace").split("\n")
