"""Real pairs from the identity: solved pairs, errors and CPU time by method.

    python -m benchmarks.accuracy.real_pairs --data FOLDER [--no-peers] [--only TEXT] [--each]

One table over all groups of pairs, then one per group. A pair is solved within 0.3 m and 1 degree
of its reference. "wrong, called ok" counts wrong poses that a method reports as valid. CPU time is
that of one call, from raw arrays to pose.
"""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks._common import real_scans
from benchmarks._common.arguments import make_parser
from benchmarks._common.contenders import Contender, is_solved, pose_error
from benchmarks._common.peers import contenders_with_start
from benchmarks._common.real_scans import RealPair
from benchmarks._common.results import Results
from scanlock.geometry.pose import Pose

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
"""First letters of the groups in each column of the first table."""


@dataclass(frozen=True, kw_only=True)
class Attempt:
    """Registration of one pair by one method."""

    group: str
    metres: float
    degrees: float
    claimed: bool | None
    seconds: float

    @property
    def solved(self) -> bool:
        """Whether both errors are within the tolerance."""
        return is_solved((self.metres, self.degrees))

    @property
    def is_wrong_but_ok(self) -> bool:
        """Whether the method reports a wrong pose as valid."""
        return bool(self.claimed) and not self.solved


def all_pairs(data: Path) -> Iterator[RealPair]:
    """Yield the pairs of all data sets."""
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
    for step in (1, 3, 6, 10):
        yield from real_scans.handheld(data, step)


def attempts(contender: Contender, pairs: Sequence[RealPair], each: bool) -> Iterator[Attempt]:
    """Register all pairs from the identity, after one call to warm up."""
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


def add_overview(results: Results, found: dict[str, list[Attempt]]) -> None:
    """Add the table of solved pairs by method and family of groups."""
    groups = {one.group for tried in found.values() for one in tried}
    families = {k: v for k, v in FAMILIES.items() if any(one.startswith(v) for one in groups)}
    rows: list[list[str]] = []
    for name, tried in found.items():
        cells = [name]
        for begins in families.values():
            solved = [one.solved for one in tried if one.group.startswith(begins)]
            cells.append(f"{sum(solved)} / {len(solved)}")
        rows.append([*cells, str(sum(one.is_wrong_but_ok for one in tried))])
    results.add_table(("method", *families, "wrong, called ok"), rows, title="solved")


def add_group(results: Results, group: str, found: dict[str, list[Attempt]]) -> None:
    """Add the table of one group."""
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
                str(sum(one.is_wrong_but_ok for one in tried)),
                f"{1e3 * np.median([one.seconds for one in tried]):.0f}",
            )
        )
    columns = ("method", "solved", "median", "95th percentile", "wrong, called ok", "CPU ms")
    results.add_table(columns, rows, title=group)


def main() -> None:
    parser = make_parser(__doc__, data=True)
    parser.add_argument("--no-peers", action="store_true", help="scanlock's methods only")
    parser.add_argument("--only", default="", help="only groups with this text in the name")
    parser.add_argument("--each", action="store_true", help="print every pair")
    arguments = parser.parse_args()
    results = Results(arguments.json)
    pairs = [pair for pair in all_pairs(arguments.data) if arguments.only in pair.group]
    found = {
        contender.name: list(attempts(contender, pairs, arguments.each))
        for contender in contenders_with_start(peers=not arguments.no_peers)
    }
    results.print_machine()
    add_overview(results, found)
    for group in dict.fromkeys(pair.group for pair in pairs):
        add_group(results, group, found)


if __name__ == "__main__":
    main()
