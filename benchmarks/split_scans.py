"""How exact the fine stages are: halves of one real scan, a known move apart.

    python benchmarks/split_scans.py --data FOLDER [--moves 20] [--no-peers]

The points of a scan are dealt at random into two halves and one half is moved by up to 1 m, 10
degrees of yaw and 2 degrees of tilt. Nothing moved between the halves and no reference had to be
measured: the move is the exact truth, and every method starts from it. What is left is how far
sampling and noise pull a method away. One table a scan, then one over all.
"""

import argparse
import os
import zlib
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import real_scans
from contenders import Cloud, Contender, ours, pose_error
from peers import available, small_gicp_peer
from scanlock.geometry.pose import Pose
from tables import machine, print_table

METHODS = ("auto", "gicp", "ndt-d2d")
PEERS = ("GICP", "VGICP")

MOST_METRES = 1.0
MOST_YAW, MOST_TILT = np.radians(10.0), np.radians(2.0)

Halves = tuple[Cloud, Cloud, Pose]
Error = tuple[float, float]


def scans(data: Path) -> dict[str, Callable[[], Cloud]]:
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
    """Return target, source and the exact pose that carries the source onto the target."""
    # A return that is not finite or lies in the sensor is none; methods differ on what they do.
    points = points[np.isfinite(points).all(axis=1) & points.any(axis=1)]
    dealt = rng.permutation(len(points))
    direction = rng.normal(size=3)
    direction *= rng.uniform(0.0, MOST_METRES) / np.linalg.norm(direction)
    yaw = rng.uniform(-MOST_YAW, MOST_YAW)
    roll, pitch = rng.uniform(-MOST_TILT, MOST_TILT, 2) / np.sqrt(2.0)
    turn = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()
    truth = Pose(turn, direction)
    target, source = points[dealt[::2]], points[dealt[1::2]]
    return target, truth.inverse().apply(source), truth


def contenders(peers: bool) -> list[Contender]:
    found = [ours(method) for method in METHODS]
    if peers:
        found += available(partial(small_gicp_peer, kind) for kind in PEERS)
    return found


def row(name: str, errors: list[Error]) -> tuple[str, ...]:
    metres, degrees = np.transpose(errors)
    return (
        name,
        f"{1e3 * np.median(metres):.2f} mm, {np.median(degrees):.4f}°",
        f"{1e3 * np.percentile(metres, 95):.2f} mm, {np.percentile(degrees, 95):.4f}°",
    )


def print_errors(title: str, found: dict[str, list[Error]]) -> None:
    print(f"\n### {title}\n")
    header = ("method", "median", "95th percentile")
    print_table(header, (row(name, errors) for name, errors in found.items()))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=os.environ.get("SCANLOCK_DATA"))
    parser.add_argument("--moves", type=int, default=20, help="moves of each scan")
    parser.add_argument("--no-peers", action="store_true", help="scanlock's methods only")
    arguments = parser.parse_args()
    if arguments.data is None:
        parser.error("give --data FOLDER or set SCANLOCK_DATA")
    compared = contenders(peers=not arguments.no_peers)
    print(machine())
    over_all: dict[str, list[Error]] = {one.name: [] for one in compared}
    for title, load in scans(arguments.data).items():
        found: dict[str, list[Error]] = {one.name: [] for one in compared}
        for move in range(arguments.moves):
            rng = np.random.default_rng([zlib.crc32(title.encode()), move])
            target, source, truth = halves(load(), rng)
            for one in compared:
                pose, _ = one.register(source, target, truth)
                found[one.name].append(pose_error(pose, truth))
        print_errors(title, found)
        for name, errors in found.items():
            over_all[name] += errors
    print_errors("all scans", over_all)


if __name__ == "__main__":
    main()
