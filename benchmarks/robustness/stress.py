"""Concurrent and repeated registration: equality of all results, and growth of memory.

    python -m benchmarks.robustness.stress [--threads 100] [--processes 8]
        [--registrations 10000]

Every method registers three simulated pairs in one thread. Then threads and processes repeat that
concurrently, and pose, metrics and probability must be equal bit by bit. Finally the default method
registers small scans repeatedly, with new preparation each time, and the memory of the process is
recorded. The exit code is 1 where a byte differs or memory grows by more than 200 bytes per
registration.
"""

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

from benchmarks._common.arguments import make_parser
from benchmarks._common.contenders import Cloud
from benchmarks._common.results import Results
from scanlock.registration.register import register
from scanlock.registration.registry import METHODS
from scanlock.registration.warm_up import warm_up
from scanlock.simulation import scan_pair

_SEEDS = (0, 1, 2)

_STRIDE = 8
"""Every eighth point of the simulated scans remains, so that calls are short."""

_MAX_GROWTH = 200.0
"""Maximum growth per registration [bytes]: the noise of the allocator over 10,000."""

_MiB = 2**20

Job = tuple[str, int]
"""A method, and the seed of a pair."""


@cache
def pair(seed: int) -> tuple[Cloud, Cloud]:
    """Return target and source of a seed."""
    found = scan_pair("street", "hdl_32e", seed, baseline=(1.0, 3.0), turn=0.2)
    return found.target.points[::_STRIDE], found.source.points[::_STRIDE]


def registered(job: Job) -> bytes:
    """Return all numbers of a result as bytes."""
    method, seed = job
    target, source = pair(seed)
    result = register(source=source, target=target, method=method)
    numbers = np.array([*astuple(result.metrics), result.probability])
    return result.target_from_source.matrix.tobytes() + numbers.tobytes()


def differing(pool: Executor, jobs: Sequence[Job], alone: dict[Job, bytes]) -> tuple[int, float]:
    """Return the number of results that differ from those of one thread, and the seconds."""
    begin = time.perf_counter()
    found = pool.map(registered, jobs)
    wrong = sum(one != alone[job] for one, job in zip(found, jobs, strict=True))
    return wrong, time.perf_counter() - begin


def resident() -> int:
    """Return the resident memory of this process [bytes]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096


def growth(count: int) -> tuple[list[list[str]], float]:
    """Return the resident memory over time, and the growth per registration [bytes]."""
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
    parser = make_parser(__doc__)
    parser.add_argument("--threads", type=int, default=100)
    parser.add_argument("--processes", type=int, default=8)
    parser.add_argument("--registrations", type=int, default=10_000)
    arguments = parser.parse_args()
    results = Results(arguments.json, "many threads")
    warm_up()
    singles = [(method, seed) for method in METHODS for seed in _SEEDS]
    alone = {job: registered(job) for job in singles}
    print(f"{len(METHODS)} methods, {len(_SEEDS)} pairs; {results.machine_line}\n")
    series, slope = growth(arguments.registrations)
    results.add_table(("registrations", "resident memory"), series, title="memory")
    rows, wrong = [], 0
    pools: list[tuple[str, Executor, int]] = [
        (f"{arguments.threads} threads", ThreadPoolExecutor(arguments.threads), 10)
    ]
    for start in multiprocessing.get_all_start_methods():
        if start != "forkserver":
            context = multiprocessing.get_context(start)
            pool = ProcessPoolExecutor(arguments.processes, mp_context=context)
            pools.append((f"{arguments.processes} processes by {start}", pool, 4))
    # Processes first: forking a process with many threads is a different test.
    for name, pool, times in reversed(pools):
        jobs = [singles[(7 * k) % len(singles)] for k in range(times * len(singles))]
        with pool:
            differ, seconds = differing(pool, jobs, alone)
        wrong += differ
        rows.append([name, str(len(jobs)), str(differ), f"{seconds:.1f} s"])
    columns = ("concurrent", "registrations", "different results", "duration")
    results.add_table(columns, rows, title="concurrency")
    print(f"\n{slope:.0f} bytes per registration, at most {_MAX_GROWTH:.0f} allowed")
    if wrong or slope > _MAX_GROWTH:
        sys.exit(1)


if __name__ == "__main__":
    main()
