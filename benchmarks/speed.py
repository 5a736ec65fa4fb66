"""Time of scanlock and its peers on the same pairs, starts and cores, and what comes of it.

    python benchmarks/speed.py --data FOLDER [--groups city handheld newer hdl32] [--pairs 5]
        [--rounds 15] [--seconds 4] [--cores 1] [--only TEXT] [--no-peers] [--pcl COMMAND]

Four tables for each group of pairs: the front end of one scan; raw arrays to pose from 0.5 m and 2
degrees off; from the identity; and with no start and the source turned to any heading. Then how far
the targets are met. All get the same float64 arrays, turn about in one process, after warm-up. A
cell holds the median and the quartiles over all runs; a pose is right within 0.3 m and 1 degree, or
what any_start.py allows where the reference is no better. Who takes longer than ``--seconds`` for
the rounds of a table gets fewer.

``--pcl COMMAND`` adds a program of your own, with PCL or what you like: `peers.Driver` says what
it is given and has to print. Its time is the one it prints.
"""

import argparse
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import real_scans
from any_start import headings, tolerance_of
from basin import random_start
from contenders import Claimed, Cloud, Contender, ours, pose_error
from cores import hold_to_cores
from laps import Lap, quartiles, turn_about
from peers import (
    Driver,
    available,
    kiss_icp_peer,
    kiss_matcher_peer,
    open3d_cloud,
    open3d_features_peer,
    open3d_icp_peer,
    small_gicp_peer,
)
from real_scans import RealPair
from scanlock.clouds.point_cloud import PointCloud
from scanlock.geometry.pose import Pose
from scanlock.registration.registry import METHODS
from tables import machine, print_table

GROUPS: dict[str, Callable[[Path], Iterator[RealPair]]] = {
    "city": partial(real_scans.kitti_drive, apart=10),
    "handheld": partial(real_scans.handheld, apart=3),
    "newer": real_scans.newer_college,
    "hdl32": real_scans.hdl32,
}

SECTIONS = ("front end of one scan", "from 0.5 m and 2°", "from the identity", "without a start")
FRONT_END, NEAR, IDENTITY, ANYWHERE = SECTIONS

GRID = 0.25
"""Of the peers' front ends [m], as small_gicp's example has it."""


@dataclass(frozen=True, kw_only=True)
class Task:
    """Two scans, where to start, and the pose between them."""

    source: Cloud
    target: Cloud
    start: Pose | None
    truth: Pose
    tolerance: tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Row:
    """What one contender did in one table."""

    name: str
    laps: list[Lap[Task, Any]]
    says_its_time: bool = False

    def cpu(self, percent: float = 50.0) -> float:
        """Return a percentile of the CPU times [s]; of the wall times for who tells its own."""
        times = [one.wall if self.says_its_time else one.cpu for one in self.laps]
        return float(np.percentile(times, percent))

    def times(self) -> list[str]:
        cpu = "-" if self.says_its_time else quartiles([one.cpu for one in self.laps], 1e3)
        return [str(len(self.laps)), cpu, quartiles([one.wall for one in self.laps], 1e3)]

    def poses(self) -> list[str]:
        """Count what is right and claimed over the tasks; a claim repeats with its task."""
        by_task = {id(one.task): one for one in self.laps}.values()
        errors = [pose_error(one.outcome[0], one.task.truth) for one in by_task]
        right = [
            metres <= one.task.tolerance[0] and degrees <= one.task.tolerance[1]
            for (metres, degrees), one in zip(errors, by_task, strict=True)
        ]
        claims = [one.outcome[1] for one in by_task]
        metres, degrees = np.median(errors, axis=0)
        if None in claims:
            said = ["-", "-"]
        else:
            both = list(zip(claims, right, strict=True))
            said = [str(both.count((True, False))), str(both.count((False, True)))]
        return [f"{sum(right)} / {len(right)}", f"{metres:.3f} m, {degrees:.3f}°", *said]


def front_ends(threads: int, peers: bool) -> dict[str, Callable[[Task], Any]]:
    """Return what each makes of the target before it sees the source."""

    def ours_of(method: str) -> Callable[[Task], Any]:
        return lambda task: METHODS[method].prepare(PointCloud.from_array(task.target))

    def by_small_gicp() -> Callable[[Task], Any]:
        import small_gicp

        return lambda task: small_gicp.preprocess_points(
            task.target, downsampling_resolution=GRID, num_threads=threads
        )

    def by_open3d() -> Callable[[Task], Any]:
        import open3d

        around = open3d.geometry.KDTreeSearchParamHybrid(1.0, 10)
        return lambda task: (
            open3d_cloud(task.target).voxel_down_sample(GRID).estimate_normals(around)
        )

    def by_kiss_icp() -> Callable[[Task], Any]:
        from kiss_icp.voxelization import voxel_down_sample

        return lambda task: voxel_down_sample(voxel_down_sample(task.target, 0.5), 1.5)

    found = {f"scanlock {name}": ours_of(name) for name in ("sgc-ndt-d2d", "auto", "gicp", "ndt")}
    makers = {
        "small_gicp preprocessing": by_small_gicp,
        "Open3D voxels and normals": by_open3d,
        "KISS-ICP downsampling": by_kiss_icp,
    }
    for name, make in makers.items() if peers else ():
        for run in available((make,)):
            found[name] = run
    return found


def compared(section: str, arguments: argparse.Namespace) -> list[Contender]:
    threads, peers = arguments.cores, not arguments.no_peers
    if section == ANYWHERE:
        found = [ours("auto", threads=threads)]
        features = (partial(open3d_features_peer, kind) for kind in ("FGR", "RANSAC"))
        makers = (partial(kiss_matcher_peer, threads), *features)
    else:
        found = [ours(name, threads=threads) for name in METHODS]
        makers = (
            partial(small_gicp_peer, "GICP", threads=threads),
            partial(small_gicp_peer, "VGICP", threads=threads),
            partial(kiss_icp_peer, threads),
            open3d_icp_peer,
        )
    return [*found, *(available(makers) if peers else ())]


def tasks_of(section: str, pairs: Sequence[RealPair]) -> Iterator[Task]:
    rng = np.random.default_rng(0)
    for index, pair in enumerate(pairs):
        near = random_start(pair.truth, 0.5, 2.0, "vertical", rng)
        starts = {NEAR: near, IDENTITY: Pose.identity()}
        turn = headings(pair.group, index, 1)[0] if section == ANYWHERE else Pose.identity()
        yield Task(
            source=turn.apply(pair.load_source()),
            target=pair.load_target(),
            start=starts.get(section),
            truth=pair.truth @ turn.inverse(),
            tolerance=tolerance_of(pair.group),
        )


def run_of(contender: Contender) -> Callable[[Task], Claimed]:
    return lambda task: contender.register(task.source, task.target, task.start)


def rows_of(
    section: str, pairs: Sequence[RealPair], arguments: argparse.Namespace
) -> dict[str, Row]:
    tasks = list(tasks_of(section, pairs))
    if section == FRONT_END:
        runs = front_ends(arguments.cores, not arguments.no_peers)
    else:
        runs = {one.name: run_of(one) for one in compared(section, arguments)}
    runs = {name: run for name, run in runs.items() if arguments.only in name}
    laps = turn_about(runs, tasks, arguments.rounds, arguments.seconds)
    found = {name: Row(name=name, laps=of_one) for name, of_one in laps.items()}
    if arguments.pcl and section in (NEAR, IDENTITY):
        driver = Driver(arguments.pcl)
        told = [driver_lap(driver, task) for task in tasks for _ in range(arguments.driver_rounds)]
        name = driver.contender.name
        found[name] = Row(name=name, laps=told, says_its_time=True)
    return found


def driver_lap(driver: Driver, task: Task) -> Lap[Task, Claimed]:
    outcome = driver.register(task.source, task.target, task.start)
    return Lap(task, outcome, 0.0, driver.seconds)


def print_section(section: str, rows: Mapping[str, Row]) -> None:
    header = ["", "runs", "CPU ms", "wall ms", "times the first"]
    if section != FRONT_END:
        header += ["right", "median error", "claimed wrongly", "right, not claimed"]
    first = next(iter(rows.values())).cpu()
    print_table(
        header,
        (
            [
                row.name,
                *row.times(),
                f"{row.cpu() / first:.2f}",
                *(row.poses() if section != FRONT_END else ()),
            ]
            for row in rows.values()
        ),
    )


TARGETS = (
    (FRONT_END, "scanlock sgc-ndt-d2d", FRONT_END, "small_gicp preprocessing", 20.0),
    (NEAR, "scanlock sgc-ndt-d2d", NEAR, "small_gicp VGICP, 1 m", 10.0),
    (ANYWHERE, "scanlock auto", NEAR, "small_gicp GICP, 1 m", 4.0),
)
"""Table and row of ours, table and row of theirs, and how many times faster ours is meant to be."""


def print_targets(group: str, found: Mapping[str, Mapping[str, Row]]) -> None:
    rows: list[list[str]] = []
    for ours_in, ours_name, theirs_in, theirs_name, aim in TARGETS:
        mine = found.get(ours_in, {}).get(ours_name)
        other = found.get(theirs_in, {}).get(theirs_name)
        if mine and other:
            rows.append(
                [
                    f"{ours_name}, {ours_in}",
                    f"{theirs_name}, {theirs_in}",
                    f"{1e3 * mine.cpu():.1f}",
                    f"{1e3 * other.cpu():.1f}",
                    f"{other.cpu() / mine.cpu():.1f}",
                    f"{other.cpu(25.0) / mine.cpu(25.0):.1f}",
                    f"{aim:g}",
                ]
            )
    if rows:
        print(f"\n### Targets, {group}\n")
        header = ["ours", "theirs", "our CPU ms", "theirs", "times faster", "by lower quartiles"]
        print_table([*header, "target"], rows)


def print_overview(group: str, found: Mapping[str, Mapping[str, Row]]) -> None:
    """Print the table of the README: who gets from raw arrays to the pose, fastest first."""
    rows = [
        [name, section, f"{1e3 * row.cpu():.0f}", *row.poses()[:2]]
        for section in (ANYWHERE, NEAR)
        for name, row in sorted(found.get(section, {}).items(), key=lambda one: one[1].cpu())
    ]
    if rows:
        print(f"\n### In short, {group}\n")
        print_table(["", "start", "CPU ms", "right", "median error"], rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=os.environ.get("SCANLOCK_DATA"))
    parser.add_argument("--groups", nargs="+", choices=GROUPS, default=["city"])
    parser.add_argument("--pairs", type=int, default=5, help="pairs of each group, evenly spaced")
    parser.add_argument("--rounds", type=int, default=15, help="over the pairs, at most")
    parser.add_argument("--seconds", type=float, default=4.0, help="a row of a table may take")
    parser.add_argument("--cores", type=int, default=1, help="to run on, and threads of each call")
    parser.add_argument("--only", default="", help="rows whose name contains this text")
    parser.add_argument("--no-peers", action="store_true", help="scanlock only")
    parser.add_argument("--pcl", default="", metavar="COMMAND", help="a program to run as well")
    parser.add_argument("--driver-rounds", type=int, default=3, help="over the pairs, with --pcl")
    arguments = parser.parse_args()
    hold_to_cores(arguments.cores)
    if arguments.data is None:
        parser.error("give --data FOLDER or set SCANLOCK_DATA")
    cores = "one core" if arguments.cores == 1 else f"{arguments.cores} cores"
    print(machine(cores))
    for group in arguments.groups:
        pairs = list(GROUPS[group](arguments.data))
        some = np.linspace(0, len(pairs) - 1, min(arguments.pairs, len(pairs))).round().astype(int)
        found: dict[str, dict[str, Row]] = {}
        for section in SECTIONS:
            found[section] = rows_of(section, [pairs[index] for index in some], arguments)
            if found[section]:
                print(f"\n### {section}, {group}\n")
                print_section(section, found[section])
        print_targets(group, found)
        print_overview(group, found)


if __name__ == "__main__":
    main()
