"""Register real pairs with any heading and no initial pose; print solved, errors and CPU time.

    python benchmarks/any_start.py --data FOLDER [--headings 12] [--peer-pairs 6]
        [--only TEXT] [--no-peers] [--each]

The source of every pair is turned about its own z axis by random headings, and no start is given.
A pair is solved within 0.3 m and 1 degree of its reference, or within the tolerance that its
table states where the reference is no better than that. Peers take seconds, so they get some pairs
of each group, evenly spaced, with one heading each; scanlock has a row of its own over those.
"""

import argparse
import math
import os
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

import real_scans
from cores import hold_to_cores
from peers import without_start
from real_scans import RealPair
from scanlock.geometry.pose import Pose
from tables import machine, print_table
from trials import HEADER, Trial, print_overview, row, tried

_USUAL = (0.3, 1.0)

TOLERANCES = {
    "kitti_drive_0005, 30": (0.5, 1.0),  # the chain of poses drifts by 0.1 m
    "kitti_drive_0005, 45": (0.5, 1.0),
    "kitti_drive_0005, 55": (0.5, 1.0),
    "car_cloud": (0.5, 2.0),  # good to 0.15 m and 0.7 degrees
    "rellis": (0.5, 2.0),  # methods agree on a pose 0.17 m and 1.2 degrees off the calibration
    "terrestrial": (0.3, 1.5),  # odometry, up to 0.7 degrees off
}
"""Metres and degrees by the beginning of a group's name."""


def all_pairs(data: Path) -> Iterator[RealPair]:
    for apart in (5, 10, 20):
        yield from real_scans.kitti_drive(data, apart)
    for apart in (30, 45, 55):
        yield from real_scans.kitti_drive_far(data, apart)
    for apart in (1, 5, 10, 15):
        yield from real_scans.kitti_00(data, apart)
    for apart in (1, 3, 6, 10):
        yield from real_scans.handheld(data, apart)
    yield from real_scans.newer_college(data)
    yield from real_scans.forest(data)
    yield from real_scans.hdl32(data)
    yield from real_scans.argoverse(data)
    yield from real_scans.car_cloud(data)
    yield from real_scans.rellis(data)
    yield from real_scans.terrestrial(data)


def headings(group: str, pair: int, count: int) -> list[Pose]:
    rng = np.random.default_rng([zlib.crc32(group.encode()), pair])
    turns = rng.uniform(-math.pi, math.pi, count)
    return [Pose.from_step(np.array([0.0, 0.0, 0.0, 0.0, 0.0, turn])) for turn in turns]


def tolerance_of(group: str) -> tuple[float, float]:
    return next((one for begin, one in TOLERANCES.items() if group.startswith(begin)), _USUAL)


def group_trials(
    group: str, pairs: Sequence[RealPair], arguments: argparse.Namespace
) -> dict[str, list[Trial]]:
    found: dict[str, list[Trial]] = {}
    ours, *peers = without_start(peers=not arguments.no_peers)
    shared = set(np.linspace(0, len(pairs) - 1, arguments.peer_pairs).round().astype(int))
    for index, pair in enumerate(pairs):
        target, source = pair.load_target(), pair.load_source()
        for number, turn in enumerate(headings(group, index, arguments.headings)):
            scene, truth = turn.apply(source), pair.truth @ turn.inverse()
            one = tried(ours, scene, target, truth, tolerance_of(group))
            found.setdefault(ours.name, []).append(one)
            if arguments.each and not (one.solved and one.claimed):
                print(f"{group} {pair.name}, heading {number}: {one}")
            if peers and number == 0 and index in shared:
                found.setdefault(f"{ours.name}, where peers ran", []).append(one)
                for peer in peers:
                    one = tried(peer, scene, target, truth, tolerance_of(group))
                    found.setdefault(peer.name, []).append(one)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=os.environ.get("SCANLOCK_DATA"))
    parser.add_argument("--headings", type=int, default=12, help="headings of each pair")
    parser.add_argument("--peer-pairs", type=int, default=6, help="pairs of a group for peers")
    parser.add_argument("--only", default="", help="groups whose name contains this text")
    parser.add_argument("--no-peers", action="store_true", help="scanlock only")
    parser.add_argument("--each", action="store_true", help="print what is not solved and claimed")
    arguments = parser.parse_args()
    hold_to_cores()
    if arguments.data is None:
        parser.error("give --data FOLDER or set SCANLOCK_DATA")
    groups: dict[str, list[RealPair]] = {}
    for pair in all_pairs(arguments.data):
        if arguments.only in pair.group:
            groups.setdefault(pair.group, []).append(pair)
    first = next(iter(groups.values()))[0]
    for contender in without_start(peers=not arguments.no_peers):
        contender.register(first.load_source(), first.load_target(), None)
    found: dict[str, dict[str, list[Trial]]] = {}
    for group, pairs in groups.items():
        found[group] = group_trials(group, pairs, arguments)
        metres, degrees = tolerance_of(group)
        print(f"\n### {group}\n\nWithin {metres:g} m and {degrees:g}°.\n")
        print_table(HEADER, [row(name, trials) for name, trials in found[group].items()])
    print(f"\n{machine()}\n")
    print_overview(found)


if __name__ == "__main__":
    main()
