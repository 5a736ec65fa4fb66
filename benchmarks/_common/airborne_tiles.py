"""Airborne tiles and their halves, with a known motion between them."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from benchmarks._common.contenders import Cloud
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.io import read_scan

_FILES = {
    "Topography": "formats/las/Topography.laz",
    "autzen_trim": "formats/las/autzen_trim.laz",
    "MixedConifer": "formats/las/MixedConifer.laz",
    "AHN": "aerial_ahn/ahn_2386_9702.laz",
    "autzen 2010": "two_epochs_autzen/autzen-bmx-2010.las",
}
"""Files of the folder of real scans."""

MOTIONS = ((2.3, 1.5), (10.0, 5.0))
"""Distances [m] and angles [deg] by which a half is moved about the middle of the tile."""

EPOCHS = ("two_epochs_autzen/autzen-bmx-2010.las", "two_epochs_autzen/autzen-bmx-2023.las")
"""Two epochs of one place, in the same coordinates."""


@dataclass(frozen=True, kw_only=True)
class TileHalves:
    """Two halves of a tile without shared points, in coordinates about its middle.

    Attributes
    ----------
    truth : Pose
        Exact pose of the source in the target.
    middle : (3,) [m]
        Map coordinates of the middle.
    spacing : float [m]
        Median distance between neighbouring points of the target.
    """

    target: Cloud
    source: Cloud
    truth: Pose
    middle: Cloud
    spacing: float

    def error(self, pose: Pose) -> float:
        """Return the root mean squared distance [m] of the source's points from their truth."""
        differences = pose.apply(self.source) - self.truth.apply(self.source)
        return math.sqrt(float((differences**2).sum(axis=1).mean()))


def read_tile(data: Path, file: str) -> Cloud:
    """Return the points of a file [m]; the names of `tiles` are files too."""
    return read_scan(data / _FILES.get(file, file)).points


def tiles(data: Path) -> dict[str, Cloud]:
    """Return the points of the tiles that are there [m], by name."""
    there = {name: file for name, file in _FILES.items() if (data / file).exists()}
    return {name: read_tile(data, file) for name, file in there.items()}


def halves(points: Cloud, metres: float, degrees: float, seed: int) -> TileHalves:
    """Return two random halves; the source is moved by a distance, and turned by an angle.

    The motion is mostly horizontal, and the turn mostly about the vertical.
    """
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(points))
    shift, turn = rng.normal(size=3) * [1.0, 1.0, 0.3], rng.normal(size=3) * [0.2, 0.2, 1.0]
    truth = Pose(
        exp_rotation(turn * math.radians(degrees) / np.linalg.norm(turn)),
        shift * metres / np.linalg.norm(shift),
    )
    middle = np.round(np.median(points, axis=0))
    target, source = points[order[::2]] - middle, points[order[1::2]] - middle
    distances, _ = cKDTree(target).query(target[::20], k=2)
    return TileHalves(
        target=target,
        source=truth.inverse().apply(source),
        truth=truth,
        middle=middle,
        spacing=float(np.median(distances[:, 1])),
    )
