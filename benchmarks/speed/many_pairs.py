"""Unit costs of many pairs: reading, preparing, registering, and the efficiency of workers.

    python -m benchmarks.speed.many_pairs [--pairs 200] [--workers 2] [--data FOLDER] [--cluster]

First table: CPU time of each stage for one scan or one pair, in the calling thread, with the scans
of a drive, each registered to the fifth scan before it. Second table: the same list of pairs by
executor, alternately: wall time, CPU time of all processes, and the fraction of the wall time of
all workers that was spent on pairs. The last column is the speed-up over the calling thread. New
processes start within their run. The workers of Dask have registered some pairs before, as on a
cluster that is in use: their first pair imports scanlock and loads the kernels.
Without real scans, simulated scans of a street are written to a temporary folder.
"""

import os
import resource
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._common.arguments import add_data, make_parser
from benchmarks._common.results import Results
from scanlock.io import write_scan
from scanlock.pipelines.many.pair_row import PairRow
from scanlock.pipelines.many.register_many import register_many
from scanlock.pipelines.many.work import read_points
from scanlock.registration.prepare import prepare
from scanlock.registration.register import register
from scanlock.simulation import scan_pair

GAP = 5
"""Number of scans from a source to its target."""

PairOfPaths = tuple[Path, Path]


def scan_files(data: Path | None, folder: Path) -> list[Path]:
    """Return the scans of a drive, or simulated ones that are written into a folder."""
    if data is not None:
        return sorted((data / "kitti_drive_0005").rglob("velodyne_points/data/*.bin"))
    for seed in range(6):
        pair = scan_pair("street", "hdl_64e", seed=seed)
        for number, cloud in enumerate((pair.target, pair.source)):
            write_scan(folder / f"{seed}{number}.bin", cloud.points.astype(np.float32))
    return sorted(folder.glob("*.bin"))


def pairs_of(files: list[Path], count: int) -> list[PairOfPaths]:
    """Return a number of pairs; the drive is repeated as needed."""
    gap = GAP if len(files) > 2 * GAP else 1
    drive = [(source, target) for target, source in zip(files, files[gap:], strict=False)]
    return [drive[row % len(drive)] for row in range(count)]


def add_unit_costs(results: Results, pairs: list[PairOfPaths]) -> None:
    """Add the table of CPU times of single stages."""
    stages: dict[str, list[float]] = {}

    def timed(name: str, work: Callable[[], Any]) -> Any:
        begin = time.process_time()
        found = work()
        stages.setdefault(name, []).append(1e3 * (time.process_time() - begin))
        return found

    for row, (source_path, target_path) in enumerate(pairs):
        if row == 1:
            stages.clear()  # the first compiles or loads the kernels
        points = [timed("read a scan", lambda path=path: read_points(path)) for path in
                  (source_path, target_path)]  # fmt: skip
        source, target = (
            timed("prepare a scan", lambda scan=scan: prepare(scan)) for scan in points
        )
        timed(
            "register a pair",
            lambda s=source, t=target: register(source=s, target=t, covariance=False),
        )
        timed(
            "register a pair with its covariance",
            lambda s=source, t=target: register(source=s, target=t, covariance="sandwich"),
        )
    rows = [
        [name, str(len(found)), *(f"{value:.1f}" for value in np.percentile(found, (50, 25, 75)))]
        for name, found in stages.items()
    ]
    columns = ("CPU ms", "runs", "median", "lower quartile", "upper quartile")
    results.add_table(columns, rows, title="unit costs")


def cpu_seconds() -> float:
    """Return the CPU time of this process and of its ended children [s]."""
    usages = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(one.ru_utime + one.ru_stime for one in usages)


def run(pairs: list[PairOfPaths], executor: Any, workers: int | None) -> tuple[Any, ...]:
    """Return wall time, CPU time and rows of one run."""
    begin, cpu = time.perf_counter(), cpu_seconds()
    rows = list(register_many(pairs, executor=executor, workers=workers))
    return time.perf_counter() - begin, cpu_seconds() - cpu, rows


def busy_fraction(wall: float, workers: int, rows: list[PairRow]) -> float:
    """Return the fraction of the wall time of all workers that was spent on pairs."""
    return sum(row.seconds or 0.0 for row in rows) / (workers * wall)


def add_executors(
    results: Results, pairs: list[PairOfPaths], workers: int, address: str | None
) -> None:
    """Add the table of executors."""
    serial, cpu, expected = run(pairs, None, None)
    rows = [table_row("calling thread", serial, cpu, 1, expected, serial)]
    if address is not None:
        run(pairs[: 4 * workers], address, None)
    for executor in ("threads", "processes", *(() if address is None else (address,))):
        wall, cpu, found = run(pairs, executor, None if executor == address else workers)
        assert found == expected, "rows must not depend on the executor"
        name = f"{workers} workers of Dask" if executor == address else f"{workers} {executor}"
        rows.append(table_row(name, wall, cpu, workers, found, serial))
    columns = ("executor", "wall s", "CPU s", "pairs/s", "busy", "speed-up")
    results.add_table(columns, rows, title=f"{len(pairs):,} pairs by executor")


def table_row(
    name: str, wall: float, cpu: float, workers: int, rows: list[PairRow], serial: float
) -> list[str]:
    """Return the cells of one run."""
    return [
        name,
        f"{wall:.1f}",
        "-" if "Dask" in name else f"{cpu:.1f}",
        f"{len(rows) / wall:.1f}",
        f"{busy_fraction(wall, workers, rows):.1%}",
        f"{serial / wall:.2f}",
    ]


def main() -> None:
    parser = make_parser(__doc__)
    add_data(parser, required=False)
    parser.add_argument("--pairs", type=int, default=200, help="pairs of the list")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument(
        "--cluster", action="store_true", help="also a Dask cluster on this machine"
    )
    arguments = parser.parse_args()
    results = Results(arguments.json, f"{arguments.workers} workers")
    results.print_machine()
    with tempfile.TemporaryDirectory() as name:
        pairs = pairs_of(scan_files(arguments.data, Path(name)), arguments.pairs)
        add_unit_costs(results, pairs[:30])
        if not arguments.cluster:
            add_executors(results, pairs, arguments.workers, None)
            return
        from distributed import LocalCluster

        with LocalCluster(
            n_workers=arguments.workers, threads_per_worker=1, dashboard_address=None
        ) as cluster:
            add_executors(results, pairs, arguments.workers, cluster.scheduler_address)


if __name__ == "__main__":
    main()
