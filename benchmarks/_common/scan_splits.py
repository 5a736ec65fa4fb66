"""Two disjoint parts of one real scan that share no ring, no block of azimuth or no shell of range.

Points of one ring err together by the calibration of its beam, and points of one block of azimuth
by the surfaces that they lie on. Halves by such units show what halves by points hide.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from benchmarks._common.contenders import Cloud
from scanlock.geometry.pose import Pose

MAX_METRES = 1.0
MAX_YAW, MAX_TILT = np.radians(10.0), np.radians(2.0)

Half = NDArray[np.bool_]
"""Mask of the points of one half."""

Split = Callable[[Cloud, np.random.Generator], Half]
"""Function that splits the points of a scan."""

Halves = tuple[Cloud, Cloud, Pose]


def by_points(points: Cloud, rng: np.random.Generator) -> Half:
    """Return a random half of the points."""
    half = np.zeros(len(points), bool)
    half[rng.permutation(len(points))[::2]] = True
    return half


def by_rings(width: float) -> Split:
    """Return the split by alternate bands of elevation of a width [deg]."""

    def split(points: Cloud, rng: np.random.Generator) -> Half:
        elevation = np.degrees(np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1])))
        return _alternate(elevation, width, rng)

    return split


def by_azimuth(width: float) -> Split:
    """Return the split by alternate blocks of azimuth, each one to two times a width [deg] wide.

    The widths are drawn at random: of a comb of equal blocks, each half fits itself best where the
    other half is displaced by one block.
    """

    def split(points: Cloud, rng: np.random.Generator) -> Half:
        azimuth = np.degrees(np.arctan2(points[:, 1], points[:, 0])) + 180.0
        edges = np.cumsum(rng.uniform(width, 2.0 * width, int(360.0 / width)))
        return np.searchsorted(edges, azimuth) % 2 == 0

    return split


def by_range(ratio: float) -> Split:
    """Return the split by alternate shells of range, each farther than the last by a ratio."""

    def split(points: Cloud, rng: np.random.Generator) -> Half:
        return _alternate(np.log(np.linalg.norm(points, axis=1)), np.log(ratio), rng)

    return split


def measured(points: Cloud) -> Cloud:
    """Return the finite points that are not at the origin."""
    # Methods differ in how they treat the others.
    return points[np.isfinite(points).all(axis=1) & points.any(axis=1)]


def random_motion(rng: np.random.Generator) -> Pose:
    """Return a motion of up to 1 m, 10 degrees of yaw and 2 degrees of roll and pitch."""
    direction = rng.normal(size=3)
    direction *= rng.uniform(0.0, MAX_METRES) / np.linalg.norm(direction)
    yaw = rng.uniform(-MAX_YAW, MAX_YAW)
    roll, pitch = rng.uniform(-MAX_TILT, MAX_TILT, 2) / np.sqrt(2.0)
    return Pose(Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix(), direction)


def with_motion(points: Cloud, half: Half, rng: np.random.Generator) -> Halves:
    """Return target, source and the exact pose of the source in the target."""
    truth = random_motion(rng)
    return points[half], truth.inverse().apply(points[~half]), truth


def _alternate(values: NDArray[np.float64], width: float, rng: np.random.Generator) -> Half:
    # The phase of the bands is random, in whole bands and parts of one.
    bands = np.floor(values / width + rng.uniform(0.0, 2.0)).astype(np.int64)
    return bands % 2 == 0
