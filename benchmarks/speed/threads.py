"""Wall time of single stages by threads, and of the D2D score by the number of Gaussians.

    python -m benchmarks.speed.threads [--repeats 30]

Simulated scans of a street (HDL-64E). First table: wall time of each stage with one thread and
with one thread per core, alternately. Second table: CPU time of one D2D score with derivatives, by
the number of Gaussians, with new and with reused neighbour lists. The area is constant in two
columns, and grows with the number of Gaussians in the others.
"""

import os
import time
from collections.abc import Callable

import numpy as np

from benchmarks._common.arguments import make_parser
from benchmarks._common.results import Results
from scanlock.clouds.point_cloud import PointCloud
from scanlock.geometry.pose import Pose
from scanlock.models.gaussians import Gaussians
from scanlock.optimisation.objectives.gaussian_scores import GaussiansToGaussians
from scanlock.registration.methods.auto.auto import Auto
from scanlock.registration.methods.fine_ndt import FineNdt
from scanlock.registration.methods.sgc_ndt import SgcNdt
from scanlock.registration.register import register
from scanlock.simulation import scan_pair
from scanlock.threads import parallel_map, using_threads

COUNTS = (300, 1000, 3000, 10_000, 30_000)
DENSITY = 0.1
"""Gaussians per square metre of the growing area."""

SIDE = 100.0
"""Side of the constant area [m]."""


def stages() -> dict[str, Callable[[int], object]]:
    """Return the stages of one registration as functions of the number of threads."""
    pair = scan_pair("street", "hdl_64e", seed=1)
    source, target = pair.source.points, pair.target.points
    clouds = [PointCloud.from_array(points) for points in (target, source)]
    auto, fine = Auto(), FineNdt()
    prepared = [fine.prepare(cloud) for cloud in clouds]

    def with_threads(work: Callable[[], object]) -> Callable[[int], object]:
        def run(threads: int) -> object:
            with using_threads(threads):
                return work()

        return run

    def whole(method: str) -> Callable[[int], object]:
        return lambda threads: register(
            source=source, target=target, method=method, threads=threads
        )

    return {
        "preparation of both scans, sgc-ndt-d2d": with_threads(
            lambda: parallel_map(SgcNdt().prepare, clouds)
        ),
        "preparation of both scans, auto": with_threads(lambda: parallel_map(auto.prepare, clouds)),
        "fine voxels of both scans": with_threads(lambda: parallel_map(fine.prepare, clouds)),
        "fine refinement": with_threads(
            lambda: fine.align(prepared[0], prepared[1], pair.target_from_source)
        ),
        "whole call, sgc-ndt-d2d": whole("sgc-ndt-d2d"),
        "whole call, auto": whole("auto"),
    }


def add_threads(results: Results, repeats: int) -> None:
    """Add the table of wall times by threads."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    counts = (1, cores or 1)
    rows: list[list[str]] = []
    for name, stage in stages().items():
        wall: dict[int, list[float]] = {count: [] for count in counts}
        stage(counts[1])
        for _ in range(repeats):
            for count in counts:
                begin = time.perf_counter()
                stage(count)
                wall[count].append(time.perf_counter() - begin)
        one, many = (1e3 * float(np.median(wall[count])) for count in counts)
        rows.append([name, f"{one:.1f}", f"{many:.1f}", f"{one / many:.2f}"])
    columns = ["wall ms", "1 thread", f"{counts[1]} threads", "speed-up"]
    results.add_table(columns, rows, title="stages by threads")


def random_gaussians(count: int, side: float, rng: np.random.Generator) -> Gaussians:
    """Return Gaussians at random positions in a square."""
    means = rng.uniform([0.0, 0.0, 0.0], [side, side, 6.0], (count, 3))
    deviations = rng.uniform(0.1, 0.6, (count, 3))
    covariances = np.einsum("ki,ij->kij", deviations**2, np.eye(3))
    return Gaussians.from_covariances(means, covariances, np.full(count, 20))


def add_gaussians(results: Results, repeats: int) -> None:
    """Add the table of CPU times by the number of Gaussians."""
    rows: list[list[str]] = []
    times: dict[str, list[float]] = {}
    for count in COUNTS:
        row = [f"{count:,}"]
        for name, side in (
            ("constant area", SIDE),
            ("growing area", float(np.sqrt(count / DENSITY))),
        ):
            rng = np.random.default_rng(0)
            both = random_gaussians(count, side, rng), random_gaussians(count, side, rng)
            new, reused = [], []
            for _ in range(max(3, repeats // 6)):
                objective = GaussiansToGaussians(target=both[0], source=both[1])
                for found in (new, reused):
                    begin = time.process_time()
                    objective.linearise(Pose.identity())
                    found.append(time.process_time() - begin)
            for kind, found in (("new lists", new), ("reused lists", reused)):
                times.setdefault(f"{name}, {kind}", []).append(1e3 * float(np.median(found)))
                row.append(f"{times[f'{name}, {kind}'][-1]:.2f}")
        rows.append(row)
    exponents = [
        f"{np.polyfit(np.log(COUNTS[1:]), np.log(one[1:]), 1)[0]:.2f}" for one in times.values()
    ]
    rows.append(["exponent from 1,000 on", *exponents])
    results.add_table(["Gaussians, CPU ms", *times], rows, title="D2D score by Gaussians")


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--repeats", type=int, default=30)
    arguments = parser.parse_args()
    results = Results(arguments.json, f"{os.cpu_count()} cores")
    results.print_machine()
    add_threads(results, arguments.repeats)
    add_gaussians(results, arguments.repeats)


if __name__ == "__main__":
    main()
