"""Six pairs of real scans of three data sets, with reference poses, to compare with peers."""

import json

import numpy as np

from scanlock.geometry.pose import Pose
from scanlock.io.scans import read_scan

STEP_AWAY = np.array([0.3, -0.2, 0.05, 0.01, -0.005, 0.03])
"""Step from the reference pose to an initial pose, less than 1 m for every point [m, rad]."""


def _floats(path, columns):
    return np.fromfile(path, np.float32).reshape(-1, columns)


def _street(folder, pair):
    folder = folder / "kitti_drive_0005"
    scans = (
        _floats(folder / "velodyne_points" / "data" / f"{int(index):010d}.bin", 4)
        for index in pair.split("_")
    )
    truth = json.loads((folder / "consensus_pairs.json").read_text())[pair]["T"]
    return *scans, Pose.from_matrix(truth)


def _forest(folder, kind):
    folder = folder / "forest_os1"
    scans = (_floats(folder / f"{kind}_t{t}_xyzl.bin", 4) for t in (0, 1))
    return *scans, Pose.from_matrix(np.loadtxt(folder / f"{kind}_reference_transform.txt"))


def _campus(folder, _):
    folder = folder / "hdl32_pair"
    scans = (read_scan(folder / f"{role}.ply").points for role in ("target", "source"))
    return *scans, Pose.from_matrix(np.loadtxt(folder / "T_target_source.txt"))


_READERS = {"street": _street, "forest": _forest, "campus": _campus}

PAIRS = ("street 0_10", "street 20_30", "street 40_50", "forest still", "forest moving", "campus")


def real_pair(folder, name):
    """Points of target and source, and the reference pose, of one of `PAIRS`."""
    data_set, _, pair = name.partition(" ")
    return _READERS[data_set](folder, pair)
