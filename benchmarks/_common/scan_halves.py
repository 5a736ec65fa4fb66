"""Two random halves of one real scan, with a known motion between them."""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from benchmarks._common import real_scans
from benchmarks._common.contenders import Cloud
from benchmarks._common.scan_splits import Halves, measured, random_motion


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
    points = measured(points)
    order = rng.permutation(len(points))
    truth = random_motion(rng)
    target, source = points[order[::2]], points[order[1::2]]
    return target, truth.inverse().apply(source), truth
