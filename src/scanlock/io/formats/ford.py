"""Scans of the Ford Campus vision and lidar data set (Pandey et al. 2011), MATLAB files.

``SCANS/Scan0075.mat`` holds a struct ``SCAN`` with the points ``XYZ`` (3, n) [m] in the frame of
the laser (x to the right, y ahead, z up), the time ``timestamp_laser`` [us], and ``X_wv``: x, y, z
[m], roll, pitch, heading [rad] of the vehicle (x ahead, y to the right, z down) in a local world
whose z points down too. The points are returned as they are, and the poses in that world turned
over, so that z points up everywhere.
"""

import math
import os
from pathlib import Path
from typing import Any

import numpy as np

from scanlock.arrays import Points
from scanlock.errors import FormatError
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.io.errors import malformed, read_bytes

_REMEDY = "name a folder of the data set's SCANS/Scan*.mat"


def _turned(roll: float, pitch: float, heading: float) -> Any:
    """Return the rotation about the fixed axes x, y, z in this order."""
    about_x, about_y, about_z = np.diag([roll, pitch, heading])
    return exp_rotation(about_z) @ exp_rotation(about_y) @ exp_rotation(about_x)


VEHICLE_FROM_LASER = Pose(_turned(math.pi, 0.0, math.pi / 2.0), np.array([2.4, -0.01, -2.3]))
"""Where the calibration of the data set has the laser on the vehicle (Pandey et al. 2011)."""

_UPRIGHT_FROM_WORLD = Pose(np.diag([1.0, -1.0, -1.0]), np.zeros(3))
"""Half a turn about x: z up for z down."""


def read_ford_scan(path: str | os.PathLike[str]) -> tuple[Points, float, Pose]:
    """Return the points of a scan, its time [s] and ``world_from_laser``.

    Parameters
    ----------
    path : path-like
        One of the data set's ``Scan*.mat``.

    Returns
    -------
    points : (n, 3) [m]
        In the frame of the laser.
    time : float [s]
    pose : Pose
        The laser in the data set's local world, turned over so that z points up.

    Raises
    ------
    FileNotFoundError
        There is no such file.
    FormatError
        It is no MATLAB file, or holds no such scan.
    """
    from scipy.io import loadmat

    path = Path(path)
    read_bytes(path, "scan")
    try:
        # Structs come as records; nothing in the file is ever called.
        content: Any = loadmat(path, simplify_cells=True, variable_names=["SCAN"])
    except Exception as error:
        # The reader meets bytes that nobody checked, and raises whatever they lead to.
        raise malformed(
            path, "header", expected="a MATLAB file up to version 7", found=str(error),
            remedy=_REMEDY,
        ) from error  # fmt: skip
    scan = content.get("SCAN")
    if not isinstance(scan, dict):
        raise malformed(path, "content", expected="a struct SCAN", found="none", remedy=_REMEDY)
    points = _numbers(path, scan, "XYZ")
    vehicle = _numbers(path, scan, "X_wv").ravel()
    time = _numbers(path, scan, "timestamp_laser").ravel()
    if points.ndim != 2 or points.shape[0] != 3 or vehicle.shape != (6,) or time.shape != (1,):
        raise malformed(
            path,
            "SCAN",
            expected="XYZ (3, n), X_wv of 6 numbers and timestamp_laser of one",
            found=f"shapes {points.shape}, {vehicle.shape} and {time.shape}",
            remedy=_REMEDY,
        )
    if not (np.isfinite(vehicle).all() and np.isfinite(time).all()):
        raise malformed(
            path, "SCAN", expected="a finite pose and time", found="NaN or Inf", remedy=_REMEDY
        )
    world_from_vehicle = Pose(_turned(*vehicle[3:].tolist()), vehicle[:3])
    pose = _UPRIGHT_FROM_WORLD @ world_from_vehicle @ VEHICLE_FROM_LASER
    return np.ascontiguousarray(points.T), 1e-6 * float(time[0]), pose


def _numbers(path: Path, scan: dict[str, Any], name: str) -> Any:
    try:
        return np.asarray(scan[name], np.float64)
    except (KeyError, TypeError, ValueError) as error:
        raise FormatError(
            f"{path}: SCAN: expected numbers in the field {name}, found {type(error).__name__}; "
            f"{_REMEDY}"
        ) from error
