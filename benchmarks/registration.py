"""Register every real pair from the identity; print solved, errors and CPU time a group.

    python benchmarks/registration.py --data FOLDER [--no-peers] [--only TEXT] [--each]

A pair is solved within 0.3 m and 1 degree of its reference. "claimed wrongly" counts pairs that
a method called right and that are not. CPU time is of one whole call, raw arrays to pose.
"""

import argparse
import os
import time
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import real_scans
from contenders import Contender, contenders, is_solved, pose_error
from real_scans import RealPair
from scanlock.geometry.pose import Pose
from tables import machine, print_table


def all_pairs(data: Path) -> Iterator[RealPair]:
    yield from real_scans.kitti_drive(data, 10)
    yield from real_scans.kitti_drive(data, 20)
    yield from real_scans.kitti_00(data)
    yield from real_scans.forest(data)
    yield from real_scans.hdl32(data)
    yield from real_scans.argoverse(data)
    yield from real_scans.newer_college(data)
    yield from real_scans.car_cloud(data)
    yield from real_scans.terrestrial(data)
    yield from real_scans.rellis(data)
    for apart in (1, 3, 6, 10):
        yield from real_scans.handheld(data, apart)


def measure(contender: Contender, pairs: list[RealPair], each: bool) -> None:
    groups: dict[str, list[tuple[float, float, bool, float]]] = defaultdict(list)
    warm = pairs[0]
    contender.register(warm.load_source(), warm.load_target(), Pose.identity())
    for pair in pairs:
        target, source = pair.load_target(), pair.load_source()
        begin = time.process_time()
        pose, claimed = contender.register(source, target, Pose.identity())
        seconds = time.process_time() - begin
        error = pose_error(pose, pair.truth)
        groups[pair.group].append((*error, claimed, seconds))
        if each:
            print(f"{pair.group} {pair.name}: {error[0]:.3f} m {error[1]:.3f} deg {claimed=}")
    print(f"\n### {contender.name}\n")
    header = ("group", "solved", "median", "95th percentile", "claimed wrongly", "CPU ms")
    print_table(header, [_row(group, rows) for group, rows in groups.items()])


def _row(group: str, rows: list[tuple[float, float, bool, float]]) -> tuple[str, ...]:
    metres, degrees = (np.array([row[k] for row in rows]) for k in (0, 1))
    solved = [is_solved((row[0], row[1])) for row in rows]
    wrong = sum(row[2] and not good for row, good in zip(rows, solved, strict=True))
    return (
        group,
        f"{sum(solved)} / {len(rows)}",
        f"{np.median(metres):.3f} m, {np.median(degrees):.3f}°",
        f"{np.percentile(metres, 95):.3f} m, {np.percentile(degrees, 95):.3f}°",
        str(wrong),
        f"{1e3 * np.median([row[3] for row in rows]):.0f}",
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=os.environ.get("SCANLOCK_DATA"))
    parser.add_argument("--no-peers", action="store_true", help="scanlock's methods only")
    parser.add_argument("--only", default="", help="groups whose name contains this text")
    parser.add_argument("--each", action="store_true", help="print every pair")
    arguments = parser.parse_args()
    if arguments.data is None:
        parser.error("give --data FOLDER or set SCANLOCK_DATA")
    pairs = [pair for pair in all_pairs(arguments.data) if arguments.only in pair.group]
    print(machine())
    for contender in contenders(peers=not arguments.no_peers):
        measure(contender, pairs, arguments.each)


if __name__ == "__main__":
    main()
