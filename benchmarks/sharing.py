"""What more threads and more Gaussians do: stages by threads, one D2D value by Gaussians.

    python benchmarks/sharing.py [--repeats 30]

Bundled simulated scans of a street (HDL-64E). The first table is the wall time of each stage with
one thread and with one for each core, turn about. The second is the CPU time of one value of the
D2D score with its derivatives, lists of near pairs included and kept, against the number of
Gaussians: more of them in one place, and a wider place of as many a square metre.
"""

import argparse
import os
import time
from collections.abc import Callable

import numpy as np

from scanlock.clouds.point_cloud import PointCloud
from scanlock.geometry.pose import Pose
from scanlock.models.gaussians import Gaussians
from scanlock.optimisation.objectives.gaussian_scores import GaussiansToGaussians
from scanlock.registration.methods.auto import Auto
from scanlock.registration.methods.fine_ndt import FineNdt
from scanlock.registration.methods.sgc_ndt import SgcNdt
from scanlock.registration.register import register
from scanlock.simulation import scan_pair
from scanlock.threads import parallel_map, using_threads
from tables import machine, print_table

COUNTS = (300, 1000, 3000, 10_000, 30_000)
DENSITY = 0.1
"""Gaussians a square metre of the wider places."""

SIDE = 100.0
"""Of the place that holds more and more of them [m]."""


def stages() -> dict[str, Callable[[int], object]]:
    """Return the stages of the registration of one pair, each to be given a number of threads."""
    pair = scan_pair("street", "hdl_64e", seed=1)
    source, target = pair.source.points, pair.target.points
    clouds = [PointCloud.from_array(points) for points in (target, source)]
    auto, fine = Auto(), FineNdt()
    kept = [fine.prepare(cloud) for cloud in clouds]

    def shared(work: Callable[[], object]) -> Callable[[int], object]:
        def run(threads: int) -> object:
            with using_threads(threads):
                return work()

        return run

    def whole(method: str) -> Callable[[int], object]:
        return lambda threads: register(
            source=source, target=target, method=method, threads=threads
        )

    return {
        "front ends of both scans, sgc-ndt-d2d": shared(
            lambda: parallel_map(SgcNdt().prepare, clouds)
        ),
        "front ends of both scans, auto": shared(lambda: parallel_map(auto.prepare, clouds)),
        "small cells of both scans": shared(lambda: parallel_map(fine.prepare, clouds)),
        "fine descent": shared(lambda: fine.align(kept[0], kept[1], pair.target_from_source)),
        "whole call, sgc-ndt-d2d": whole("sgc-ndt-d2d"),
        "whole call, auto": whole("auto"),
    }


def threads_table(repeats: int) -> None:
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
    print_table(["wall ms", "1 thread", f"{counts[1]} threads", "times"], rows)


def scattered(count: int, side: float, rng: np.random.Generator) -> Gaussians:
    means = rng.uniform([0.0, 0.0, 0.0], [side, side, 6.0], (count, 3))
    deviations = rng.uniform(0.1, 0.6, (count, 3))
    covariances = np.einsum("ki,ij->kij", deviations**2, np.eye(3))
    return Gaussians.from_covariances(means, covariances, np.full(count, 20))


def gaussians_table(repeats: int) -> None:
    rows: list[list[str]] = []
    times: dict[str, list[float]] = {}
    for count in COUNTS:
        row = [f"{count:,}"]
        for name, side in (("one place", SIDE), ("wider", float(np.sqrt(count / DENSITY)))):
            rng = np.random.default_rng(0)
            both = scattered(count, side, rng), scattered(count, side, rng)
            fresh, kept = [], []
            for _ in range(max(3, repeats // 6)):
                objective = GaussiansToGaussians(target=both[0], source=both[1])
                for found in (fresh, kept):
                    begin = time.process_time()
                    objective.linearise(Pose.identity())
                    found.append(time.process_time() - begin)
            for kind, found in (("lists anew", fresh), ("lists kept", kept)):
                times.setdefault(f"{name}, {kind}", []).append(1e3 * float(np.median(found)))
                row.append(f"{times[f'{name}, {kind}'][-1]:.2f}")
        rows.append(row)
    steep = [
        f"{np.polyfit(np.log(COUNTS[1:]), np.log(one[1:]), 1)[0]:.2f}" for one in times.values()
    ]
    print_table(["Gaussians, CPU ms", *times], [*rows, ["exponent from 1,000 on", *steep]])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=30)
    arguments = parser.parse_args()
    print(machine(f"{os.cpu_count()} cores"), "\n")
    threads_table(arguments.repeats)
    print()
    gaussians_table(arguments.repeats)


if __name__ == "__main__":
    main()
