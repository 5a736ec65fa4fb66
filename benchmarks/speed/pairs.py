"""CPU time and success of scanlock and other libraries on the same pairs, starts and cores.

    python -m benchmarks.speed.pairs --data FOLDER [--groups city handheld newer hdl32] [--pairs 5]
        [--rounds 15] [--seconds 4] [--cores 1] [--only TEXT] [--no-peers] [--pcl COMMAND]

Four tables per group of pairs: preprocessing of one scan; registration of raw arrays from a start
0.5 m and 2 degrees off; from the identity; and without a start, with the source at any heading.
Two tables follow: speed relative to the goals, and a summary.

All contenders get the same float64 arrays and run alternately in one process, after warm-up. A cell
holds the median and the quartiles over all runs. A pose is solved within 0.3 m and 1 degree, or
within the tolerance of `turned_pairs` where the reference is less accurate. A contender that needs
more than ``--seconds`` for the rounds of a table gets fewer rounds.

``--pcl COMMAND`` adds a program, for example one built on PCL. `peers.ExternalProgram` documents
its arguments and its output; its time is the one that it prints.
"""

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._common import real_scans
from benchmarks._common.arguments import make_parser
from benchmarks._common.contenders import (
    Cloud,
    Contender,
    PoseAndClaim,
    pose_error,
    scanlock_contender,
)
from benchmarks._common.cores import pin_to_cores
from benchmarks._common.laps import Lap, quartiles, run_interleaved
from benchmarks._common.peers import (
    ExternalProgram,
    available,
    kiss_icp_peer,
    kiss_matcher_peer,
    open3d_cloud,
    open3d_features_peer,
    open3d_icp_peer,
    small_gicp_peer,
)
from benchmarks._common.real_scans import RealPair
from benchmarks._common.results import Results
from benchmarks._common.starts import random_start
from benchmarks._common.turned_pairs import headings, tolerance_of
from scanlock.clouds.point_cloud import PointCloud
from scanlock.geometry.pose import Pose
from scanlock.registration.registry import METHODS

GROUPS: dict[str, Callable[[Path], Iterator[RealPair]]] = {
    "city": partial(real_scans.kitti_drive, step=10),
    "handheld": partial(real_scans.handheld, step=3),
    "newer": real_scans.newer_college,
    "hdl32": real_scans.hdl32,
}

SECTIONS = (
    "preprocessing of one scan",
    "from 0.5 m and 2°",
    "from the identity",
    "without a start",
)
PREPROCESSING, NEAR, IDENTITY, NO_START = SECTIONS

VOXEL_SIZE = 0.25
"""Voxel size of the peers' preprocessing [m], from small_gicp's example."""


@dataclass(frozen=True, kw_only=True)
class Task:
    """Two scans, a start, and the true pose."""

    source: Cloud
    target: Cloud
    start: Pose | None
    truth: Pose
    tolerance: tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Row:
    """Runs of one contender in one table."""

    name: str
    laps: list[Lap[Task, Any]]
    has_own_clock: bool = False

    def cpu(self, percent: float = 50.0) -> float:
        """Return a percentile of the CPU times [s], or of the times that a program printed."""
        times = [one.wall if self.has_own_clock else one.cpu for one in self.laps]
        return float(np.percentile(times, percent))

    def times(self) -> list[str]:
        """Return the cells of runs, CPU time and wall time."""
        cpu = "-" if self.has_own_clock else quartiles([one.cpu for one in self.laps], 1e3)
        return [str(len(self.laps)), cpu, quartiles([one.wall for one in self.laps], 1e3)]

    def poses(self) -> list[str]:
        """Return the cells of solved tasks, median error and wrong claims, once per task."""
        by_task = {id(one.task): one for one in self.laps}.values()
        errors = [pose_error(one.outcome[0], one.task.truth) for one in by_task]
        solved = [
            metres <= one.task.tolerance[0] and degrees <= one.task.tolerance[1]
            for (metres, degrees), one in zip(errors, by_task, strict=True)
        ]
        claims = [one.outcome[1] for one in by_task]
        metres, degrees = np.median(errors, axis=0)
        if None in claims:
            wrong = ["-", "-"]
        else:
            both = list(zip(claims, solved, strict=True))
            wrong = [str(both.count((True, False))), str(both.count((False, True)))]
        return [f"{sum(solved)} / {len(solved)}", f"{metres:.3f} m, {degrees:.3f}°", *wrong]


def preprocessings(threads: int, peers: bool) -> dict[str, Callable[[Task], Any]]:
    """Return the preprocessing of the target by each contender."""

    def by_scanlock(method: str) -> Callable[[Task], Any]:
        return lambda task: METHODS[method].prepare(PointCloud.from_array(task.target))

    def by_small_gicp() -> Callable[[Task], Any]:
        import small_gicp

        return lambda task: small_gicp.preprocess_points(
            task.target, downsampling_resolution=VOXEL_SIZE, num_threads=threads
        )

    def by_open3d() -> Callable[[Task], Any]:
        import open3d

        around = open3d.geometry.KDTreeSearchParamHybrid(1.0, 10)
        return lambda task: (
            open3d_cloud(task.target).voxel_down_sample(VOXEL_SIZE).estimate_normals(around)
        )

    def by_kiss_icp() -> Callable[[Task], Any]:
        from kiss_icp.voxelization import voxel_down_sample

        return lambda task: voxel_down_sample(voxel_down_sample(task.target, 0.5), 1.5)

    found = {
        f"scanlock {name}": by_scanlock(name) for name in ("sgc-ndt-d2d", "auto", "gicp", "ndt")
    }
    makers = {
        "small_gicp preprocessing": by_small_gicp,
        "Open3D voxels and normals": by_open3d,
        "KISS-ICP downsampling": by_kiss_icp,
    }
    for name, make in makers.items() if peers else ():
        for run in available((make,)):
            found[name] = run
    return found


def contenders_of(section: str, arguments: argparse.Namespace) -> list[Contender]:
    """Return the contenders of a table."""
    threads, peers = arguments.cores, not arguments.no_peers
    if section == NO_START:
        found = [scanlock_contender("auto", threads=threads)]
        features = (partial(open3d_features_peer, kind) for kind in ("FGR", "RANSAC"))
        makers = (partial(kiss_matcher_peer, threads), *features)
    else:
        found = [scanlock_contender(name, threads=threads) for name in METHODS]
        makers = (
            partial(small_gicp_peer, "GICP", threads=threads),
            partial(small_gicp_peer, "VGICP", threads=threads),
            partial(kiss_icp_peer, threads),
            open3d_icp_peer,
        )
    return [*found, *(available(makers) if peers else ())]


def tasks_of(section: str, pairs: Sequence[RealPair]) -> Iterator[Task]:
    """Yield the tasks of a table."""
    rng = np.random.default_rng(0)
    for index, pair in enumerate(pairs):
        near = random_start(pair.truth, 0.5, 2.0, "vertical", rng)
        starts = {NEAR: near, IDENTITY: Pose.identity()}
        turn = headings(pair.group, index, 1)[0] if section == NO_START else Pose.identity()
        yield Task(
            source=turn.apply(pair.load_source()),
            # KISS-ICP refuses read-only arrays.
            target=np.array(pair.load_target()),
            start=starts.get(section),
            truth=pair.truth @ turn.inverse(),
            tolerance=tolerance_of(pair.group),
        )


def run_of(contender: Contender) -> Callable[[Task], PoseAndClaim]:
    """Return the run of a contender on a task."""
    return lambda task: contender.register(task.source, task.target, task.start)


def rows_of(
    section: str, pairs: Sequence[RealPair], arguments: argparse.Namespace
) -> dict[str, Row]:
    """Return the runs of a table, by contender."""
    tasks = list(tasks_of(section, pairs))
    if section == PREPROCESSING:
        runs = preprocessings(arguments.cores, not arguments.no_peers)
    else:
        runs = {one.name: run_of(one) for one in contenders_of(section, arguments)}
    runs = {name: run for name, run in runs.items() if arguments.only in name}
    laps = run_interleaved(runs, tasks, arguments.rounds, arguments.seconds)
    found = {name: Row(name=name, laps=of_one) for name, of_one in laps.items()}
    if arguments.pcl and section in (NEAR, IDENTITY):
        program = ExternalProgram(arguments.pcl)
        runs_of_program = [
            program_lap(program, task) for task in tasks for _ in range(arguments.program_rounds)
        ]
        name = program.contender.name
        found[name] = Row(name=name, laps=runs_of_program, has_own_clock=True)
    return found


def program_lap(program: ExternalProgram, task: Task) -> Lap[Task, PoseAndClaim]:
    """Return a run of an external program with the time that it printed."""
    outcome = program.register(task.source, task.target, task.start)
    return Lap(task, outcome, 0.0, program.seconds)


def add_section(results: Results, section: str, group: str, rows: Mapping[str, Row]) -> None:
    """Add the table of one section."""
    columns = ["", "runs", "CPU ms", "wall ms", "relative to the first"]
    if section != PREPROCESSING:
        columns += ["solved", "median error", "wrong, called ok", "right, not called ok"]
    first = next(iter(rows.values())).cpu()
    results.add_table(
        columns,
        (
            [
                row.name,
                *row.times(),
                f"{row.cpu() / first:.2f}",
                *(row.poses() if section != PREPROCESSING else ()),
            ]
            for row in rows.values()
        ),
        title=f"{section}, {group}",
    )


GOALS = (
    (PREPROCESSING, "scanlock sgc-ndt-d2d", PREPROCESSING, "small_gicp preprocessing", 20.0),
    (NEAR, "scanlock sgc-ndt-d2d", NEAR, "small_gicp VGICP, 1 m", 10.0),
    (NO_START, "scanlock auto", NEAR, "small_gicp GICP, 1 m", 4.0),
)
"""Table and row of scanlock, table and row of a peer, and the intended ratio of CPU times."""


def add_goals(results: Results, group: str, found: Mapping[str, Mapping[str, Row]]) -> None:
    """Add the table of CPU times relative to the goals."""
    rows: list[list[str]] = []
    for our_table, our_name, peer_table, peer_name, goal in GOALS:
        own = found.get(our_table, {}).get(our_name)
        peer = found.get(peer_table, {}).get(peer_name)
        if own and peer:
            rows.append(
                [
                    f"{our_name}, {our_table}",
                    f"{peer_name}, {peer_table}",
                    f"{1e3 * own.cpu():.1f}",
                    f"{1e3 * peer.cpu():.1f}",
                    f"{peer.cpu() / own.cpu():.1f}",
                    f"{peer.cpu(25.0) / own.cpu(25.0):.1f}",
                    f"{goal:g}",
                ]
            )
    if rows:
        columns = [
            "scanlock",
            "peer",
            "CPU ms",
            "CPU ms of the peer",
            "ratio",
            "of lower quartiles",
        ]
        results.add_table([*columns, "goal"], rows, title=f"goals, {group}")


def add_summary(results: Results, group: str, found: Mapping[str, Mapping[str, Row]]) -> None:
    """Add the table of the README: CPU time from raw arrays to pose, fastest first."""
    rows = [
        [name, section, f"{1e3 * row.cpu():.0f}", *row.poses()[:2]]
        for section in (NO_START, NEAR)
        for name, row in sorted(found.get(section, {}).items(), key=lambda one: one[1].cpu())
    ]
    if rows:
        columns = ["", "start", "CPU ms", "solved", "median error"]
        results.add_table(columns, rows, title=f"summary, {group}")


def main() -> None:
    parser = make_parser(__doc__, data=True)
    parser.add_argument("--groups", nargs="+", choices=GROUPS, default=["city"])
    parser.add_argument("--pairs", type=int, default=5, help="pairs of each group, evenly spaced")
    parser.add_argument(
        "--rounds", type=int, default=15, help="maximum number of rounds over the pairs"
    )
    parser.add_argument("--seconds", type=float, default=4.0, help="maximum duration of a row [s]")
    parser.add_argument("--cores", type=int, default=1, help="cores, and threads of each call")
    parser.add_argument("--only", default="", help="only rows with this text in the name")
    parser.add_argument("--no-peers", action="store_true", help="scanlock only")
    parser.add_argument("--pcl", default="", metavar="COMMAND", help="also run a program")
    parser.add_argument("--program-rounds", type=int, default=3, help="rounds of --pcl")
    arguments = parser.parse_args()
    pin_to_cores(arguments.cores)
    cores = "one core" if arguments.cores == 1 else f"{arguments.cores} cores"
    results = Results(arguments.json, cores)
    results.print_machine()
    for group in arguments.groups:
        pairs = list(GROUPS[group](arguments.data))
        some = np.linspace(0, len(pairs) - 1, min(arguments.pairs, len(pairs))).round().astype(int)
        found: dict[str, dict[str, Row]] = {}
        for section in SECTIONS:
            found[section] = rows_of(section, [pairs[index] for index in some], arguments)
            if found[section]:
                add_section(results, section, group, found[section])
        add_goals(results, group, found)
        add_summary(results, group, found)


if __name__ == "__main__":
    main()
