"""Scans of the Ford Campus vision and lidar data set (Pandey et al. 2011), in MATLAB files.

``SCANS/Scan0075.mat`` has a struct ``SCAN`` with the points ``XYZ`` (3, n) [m] in the frame of the
laser (x to the right, y ahead, z up), the time ``timestamp_laser`` [us], and ``X_wv``: x, y, z
[m], roll, pitch and heading [rad] of the vehicle (x ahead, y to the right, z down) in a local
world with z down. Points are returned unchanged. Poses are returned in that world rotated by half
a turn about x, so that z points up.
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

_REMEDY = "use the files SCANS/Scan*.mat of the data set"


def _rotation(roll: float, pitch: float, heading: float) -> Any:
    """Return the rotation about the fixed axes x, y and z, in this order."""
    about_x, about_y, about_z = np.diag([roll, pitch, heading])
    return exp_rotation(about_z) @ exp_rotation(about_y) @ exp_rotation(about_x)


VEHICLE_FROM_LASER = Pose(_rotation(math.pi, 0.0, math.pi / 2.0), np.array([2.4, -0.01, -2.3]))
"""Pose of the laser on the vehicle, from the calibration of the data set (Pandey et al. 2011)."""

_UPRIGHT_FROM_WORLD = Pose(np.diag([1.0, -1.0, -1.0]), np.zeros(3))
"""Half a turn about x, from z down to z up."""


def read_ford_scan(path: str | os.PathLike[str]) -> tuple[Points, float, Pose]:
    """Read the points of a scan, its time and its pose.

    Parameters
    ----------
    path : path-like
        A file ``Scan*.mat`` of the data set.

    Returns
    -------
    points : (n, 3) [m]
        In the frame of the laser.
    time : float [s]
    pose : Pose
        ``world_from_laser``, in the local world of the data set with z up.

    Raises
    ------
    FileNotFoundError
        The file does not exist.
    FormatError
        Not a MATLAB file, or one without such a scan.
    """
    from scipy.io import loadmat

    path = Path(path)
    read_bytes(path, "scan")
    try:
        # loadmat reads data only; it executes nothing from the file.
        content: Any = loadmat(path, simplify_cells=True, variable_names=["SCAN"])
    except Exception as error:
        # loadmat does not check its input and raises many types of errors.
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
            expected="XYZ of shape (3, n), 6 numbers X_wv and 1 number timestamp_laser",
            found=f"shapes {points.shape}, {vehicle.shape} and {time.shape}",
            remedy=_REMEDY,
        )
    if not (np.isfinite(vehicle).all() and np.isfinite(time).all()):
        raise malformed(
            path, "SCAN", expected="a finite pose and time", found="NaN or Inf", remedy=_REMEDY
        )
    world_from_vehicle = Pose(_rotation(*vehicle[3:].tolist()), vehicle[:3])
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
