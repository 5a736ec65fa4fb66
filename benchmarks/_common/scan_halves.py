"""Two random halves of one real scan, with a known motion between them."""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks._common import real_scans
from benchmarks._common.contenders import Cloud
from scanlock.geometry.pose import Pose

MAX_METRES = 1.0
MAX_YAW, MAX_TILT = np.radians(10.0), np.radians(2.0)

Halves = tuple[Cloud, Cloud, Pose]


def scans(data: Path) -> dict[str, Callable[[], Cloud]]:
    """Return the functions that read five scans, by title."""
    return {
        "kitti_drive_0005, scan 0": next(real_scans.kitti_drive(data, 5)).load_target,
        "kitti_00, scan 0": next(real_scans.kitti_00(data)).load_target,
        "handheld_balm, scan 10": _target_of(real_scans.handheld(data, 1), "10-11"),
        "forest_os1, moving": _target_of(real_scans.forest(data), "moving"),
        "hdl32_pair, target": next(real_scans.hdl32(data)).load_target,
    }


def _target_of(pairs: Iterator[real_scans.RealPair], name: str) -> Callable[[], Cloud]:
    return next(pair.load_target for pair in pairs if pair.name == name)


def halves(points: Cloud, rng: np.random.Generator) -> Halves:
    """Return target, source and the exact pose of the source in the target."""
    # Methods differ in how they treat points that are not finite or at the origin.
    points = points[np.isfinite(points).all(axis=1) & points.any(axis=1)]
    order = rng.permutation(len(points))
    direction = rng.normal(size=3)
    direction *= rng.uniform(0.0, MAX_METRES) / np.linalg.norm(direction)
    yaw = rng.uniform(-MAX_YAW, MAX_YAW)
    roll, pitch = rng.uniform(-MAX_TILT, MAX_TILT, 2) / np.sqrt(2.0)
    turn = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()
    truth = Pose(turn, direction)
    target, source = points[order[::2]], points[order[1::2]]
    return target, truth.inverse().apply(source), truth
