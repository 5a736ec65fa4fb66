"""Registering under stress: from 100 threads and 8 processes at once, and 10,000 times on end.

    python benchmarks/stress.py [--threads 100] [--processes 8] [--registrations 10000]

Every method registers three simulated pairs of scans once, alone; then threads and processes do so
all at once, and each result must have the bytes of the one found alone: pose, metrics and
probability. Then the default method registers small scans on end, prepared anew each time, and the
memory of the process is read on the way. Ends with an error where a byte differs or memory grows by
more than 200 bytes a registration.
"""

import argparse
import gc
import multiprocessing
import sys
import time
from collections.abc import Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import astuple
from functools import cache
from pathlib import Path

import numpy as np

from contenders import Cloud
from scanlock.registration.register import register
from scanlock.registration.registry import METHODS
from scanlock.registration.warm_up import warm_up
from scanlock.simulation import scan_pair
from tables import machine, print_table

_SEEDS = (0, 1, 2)

_THINNING = 8
"""Of the simulated scans every so many-th point is left, so that calls are short and many."""

_MOST_GROWTH = 200.0
"""Bytes a registration may leave behind: what the allocator's noise is over 10,000."""

_MiB = 2**20

Job = tuple[str, int]
"""A method, and the seed of a pair."""


@cache
def pair(seed: int) -> tuple[Cloud, Cloud]:
    found = scan_pair("street", "hdl_32e", seed, baseline=(1.0, 3.0), turn=0.2)
    return found.target.points[::_THINNING], found.source.points[::_THINNING]


def told(job: Job) -> bytes:
    """Return all numbers of a result as bytes."""
    method, seed = job
    target, source = pair(seed)
    result = register(source=source, target=target, method=method)
    numbers = np.array([*astuple(result.metrics), result.probability])
    return result.target_from_source.matrix.tobytes() + numbers.tobytes()


def differing(pool: Executor, jobs: Sequence[Job], alone: dict[Job, bytes]) -> tuple[int, float]:
    """Return how many results differ from those found alone, and the seconds it took."""
    begin = time.perf_counter()
    found = pool.map(told, jobs)
    wrong = sum(one != alone[job] for one, job in zip(found, jobs, strict=True))
    return wrong, time.perf_counter() - begin


def resident() -> int:
    """Return the memory of this process that is in use [bytes]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096


def growth(count: int) -> tuple[list[list[str]], float]:
    """Return the memory on the way, and the bytes that each registration leaves behind."""
    target, source = pair(0)
    for _ in range(max(20, count // 10)):
        register(source=source, target=target)
    done, used = [], []
    step = max(1, count // 10)
    for number in range(count + 1):
        if number % step == 0:
            gc.collect()
            done.append(number)
            used.append(resident())
        register(source=source, target=target)
    slope = float(np.polyfit(done, used, 1)[0])
    rows = [[f"{n:,}", f"{r / _MiB:.1f} MiB"] for n, r in zip(done, used, strict=True)]
    return rows, slope


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--threads", type=int, default=100)
    parser.add_argument("--processes", type=int, default=8)
    parser.add_argument("--registrations", type=int, default=10_000)
    arguments = parser.parse_args()
    warm_up()
    singles = [(method, seed) for method in METHODS for seed in _SEEDS]
    alone = {job: told(job) for job in singles}
    print(f"{len(METHODS)} methods, {len(_SEEDS)} pairs; {machine('many threads')}\n")
    series, slope = growth(arguments.registrations)
    print_table(("registrations done", "memory in use"), series)
    print()
    rows, wrong = [], 0
    pools: list[tuple[str, Executor, int]] = [
        (f"{arguments.threads} threads", ThreadPoolExecutor(arguments.threads), 10)
    ]
    for way in multiprocessing.get_all_start_methods():
        if way != "forkserver":
            context = multiprocessing.get_context(way)
            pool = ProcessPoolExecutor(arguments.processes, mp_context=context)
            pools.append((f"{arguments.processes} processes by {way}", pool, 4))
    # Processes first: one forked from many threads would be another matter.
    for name, pool, times in reversed(pools):
        jobs = [singles[(7 * k) % len(singles)] for k in range(times * len(singles))]
        with pool:
            differ, seconds = differing(pool, jobs, alone)
        wrong += differ
        rows.append([name, str(len(jobs)), str(differ), f"{seconds:.1f} s"])
    print_table(("at once", "registrations", "that differ from one alone", "took"), rows)
    print(f"\n{slope:.0f} bytes a registration; {_MOST_GROWTH:.0f} are allowed")
    if wrong or slope > _MOST_GROWTH:
        sys.exit(1)


if __name__ == "__main__":
    main()
