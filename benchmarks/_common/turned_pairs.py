"""Real pairs, turned: which pairs, which headings or rotations, the tolerance of each group."""

import math
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks._common import real_scans
from benchmarks._common.contenders import MAX_DEGREES, MAX_METRES
from benchmarks._common.real_scans import RealPair
from scanlock.geometry.pose import Pose

TOLERANCES = {
    "kitti_drive_0005, 30": (0.5, 1.0),  # the chained reference poses drift by 0.1 m
    "kitti_drive_0005, 45": (0.5, 1.0),
    "kitti_drive_0005, 55": (0.5, 1.0),
    "car_cloud": (0.5, 2.0),  # reference accurate to 0.15 m and 0.7 degrees
    "rellis": (0.5, 2.0),  # all methods agree on a pose 0.17 m and 1.2 degrees off the calibration
    "terrestrial": (0.3, 1.5),  # reference from odometry, errors up to 0.7 degrees
}
"""Metres and degrees, by the first letters of the group's name."""


def all_pairs(data: Path) -> Iterator[RealPair]:
    """Yield the pairs of all data sets, grouped by data set and distance."""
    for step in (5, 10, 20):
        yield from real_scans.kitti_drive(data, step)
    for step in (30, 45, 55):
        yield from real_scans.kitti_drive_far(data, step)
    for step in (1, 5, 10, 15):
        yield from real_scans.kitti_00(data, step)
    for step in (1, 3, 6, 10):
        yield from real_scans.handheld(data, step)
    yield from real_scans.newer_college(data)
    yield from real_scans.forest(data)
    yield from real_scans.hdl32(data)
    yield from real_scans.argoverse(data)
    yield from real_scans.car_cloud(data)
    yield from real_scans.rellis(data)
    yield from real_scans.terrestrial(data)


def headings(group: str, pair: int, count: int) -> list[Pose]:
    """Return rotations about the vertical by random angles, seeded by group and pair."""
    rng = np.random.default_rng([zlib.crc32(group.encode()), pair])
    angles = rng.uniform(-math.pi, math.pi, count)
    return [Pose.from_step(np.array([0.0, 0.0, 0.0, 0.0, 0.0, angle])) for angle in angles]


def rotations(group: str, pair: int, count: int) -> list[Pose]:
    """Return rotations that are uniform over all attitudes, seeded by group and pair."""
    rng = np.random.default_rng([zlib.crc32(group.encode()), pair, 1])
    turns = Rotation.random(count, rng=rng)
    return [Pose(turn.as_matrix(), np.zeros(3)) for turn in turns]


def tolerance_of(group: str) -> tuple[float, float]:
    """Return the errors within which a pair of a group counts as solved [m, deg]."""
    usual = (MAX_METRES, MAX_DEGREES)
    return next((one for begin, one in TOLERANCES.items() if group.startswith(begin)), usual)
