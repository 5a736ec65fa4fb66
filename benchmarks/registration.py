"""Register every real pair from the identity; print solved, errors and CPU time by method.

    python benchmarks/registration.py --data FOLDER [--no-peers] [--only TEXT] [--each]

One table over all groups of pairs, then one a group. A pair is solved within 0.3 m and 1 degree of
its reference. "claimed wrongly" counts pairs that a method called right and that are not. CPU time
is of one whole call, raw arrays to pose.
"""

import argparse
import os
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import real_scans
from contenders import Contender, is_solved, pose_error
from peers import with_start
from real_scans import RealPair
from scanlock.geometry.pose import Pose
from tables import machine, print_table

FAMILIES: dict[str, tuple[str, ...]] = {
    "city, 10 apart": ("kitti_drive_0005, 10 apart",),
    "city, 20 apart": ("kitti_drive_0005, 20 apart",),
    "kitti_00": ("kitti_00",),
    "other outdoors": ("forest", "hdl32", "av2", "newer", "car_cloud"),
    "handheld, 1": ("handheld_balm, 1 apart",),
    "handheld, 3": ("handheld_balm, 3 apart",),
    "handheld, 6": ("handheld_balm, 6 apart",),
    "handheld, 10": ("handheld_balm, 10 apart",),
    "corridor": ("terrestrial",),
    "rellis": ("rellis",),
}
"""Columns of the first table: how the names of their groups begin."""


@dataclass(frozen=True, kw_only=True)
class Attempt:
    """What one method made of one pair."""

    group: str
    metres: float
    degrees: float
    claimed: bool
    seconds: float

    @property
    def solved(self) -> bool:
        return is_solved((self.metres, self.degrees))

    @property
    def claimed_wrongly(self) -> bool:
        return self.claimed and not self.solved


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


def attempts(contender: Contender, pairs: Sequence[RealPair], each: bool) -> Iterator[Attempt]:
    contender.register(pairs[0].load_source(), pairs[0].load_target(), Pose.identity())
    for pair in pairs:
        target, source = pair.load_target(), pair.load_source()
        begin = time.process_time()
        pose, claimed = contender.register(source, target, Pose.identity())
        seconds = time.process_time() - begin
        metres, degrees = pose_error(pose, pair.truth)
        if each:
            print(f"{contender.name}, {pair.group} {pair.name}: ", end="")
            print(f"{metres:.3f} m {degrees:.3f} deg {claimed=}", flush=True)
        yield Attempt(
            group=pair.group, metres=metres, degrees=degrees, claimed=claimed, seconds=seconds
        )


def print_overview(found: dict[str, list[Attempt]]) -> None:
    groups = {one.group for tried in found.values() for one in tried}
    families = {k: v for k, v in FAMILIES.items() if any(one.startswith(v) for one in groups)}
    rows: list[list[str]] = []
    for name, tried in found.items():
        cells = [name]
        for begins in families.values():
            solved = [one.solved for one in tried if one.group.startswith(begins)]
            cells.append(f"{sum(solved)} / {len(solved)}")
        rows.append([*cells, str(sum(one.claimed_wrongly for one in tried))])
    print_table(("method", *families, "claimed wrongly"), rows)


def print_group(group: str, found: dict[str, list[Attempt]]) -> None:
    rows: list[tuple[str, ...]] = []
    for name, everything in found.items():
        tried = [one for one in everything if one.group == group]
        metres, degrees = [one.metres for one in tried], [one.degrees for one in tried]
        rows.append(
            (
                name,
                f"{sum(one.solved for one in tried)} / {len(tried)}",
                f"{np.median(metres):.3f} m, {np.median(degrees):.3f}°",
                f"{np.percentile(metres, 95):.3f} m, {np.percentile(degrees, 95):.3f}°",
                str(sum(one.claimed_wrongly for one in tried)),
                f"{1e3 * np.median([one.seconds for one in tried]):.0f}",
            )
        )
    print(f"\n### {group}\n")
    header = ("method", "solved", "median", "95th percentile", "claimed wrongly", "CPU ms")
    print_table(header, rows)


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
    found = {
        contender.name: list(attempts(contender, pairs, arguments.each))
        for contender in with_start(peers=not arguments.no_peers)
    }
    print(machine(), "\n")
    print_overview(found)
    for group in dict.fromkeys(pair.group for pair in pairs):
        print_group(group, found)


if __name__ == "__main__":
    main()
