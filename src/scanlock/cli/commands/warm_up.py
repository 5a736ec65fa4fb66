"""``scanlock warmup``: compile all kernels."""

import os
import time
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

_Step = TypeVar("_Step")


def warm_up() -> None:
    """Compile all kernels and cache them on disk, so that later commands start at once."""
    from scanlock.cli.compile_notice import compile_watch
    from scanlock.cli.console import print_line, waiting
    from scanlock.registration.warm_up import warm_up_verification

    begin = time.perf_counter()
    with compile_watch() as watch, waiting("compiling"):
        _compile_in(_cores() if _compiles_here() else 1)
        for step in _steps():
            step()
        warm_up_verification()
    seconds = time.perf_counter() - begin
    if watch.compiled:
        print_line(f"compiled everything in {seconds:.0f} s; commands now start at once")
    else:
        print_line(f"everything was compiled already; loaded it in {seconds:.1f} s")
    print_line(cache_location())


def _compiles_here() -> bool:
    """Compile a first kernel if necessary; return whether it was compiled and cached on disk."""
    import numpy as np

    from scanlock.kernels.points import polar
    from scanlock.segmentation.clusters import ClusterFinder

    ClusterFinder().grid.cells(np.ones((1, 3)))
    stats = getattr(polar.polar_cells, "stats", None)
    return stats is not None and stats.cache_path is not None and bool(stats.cache_misses)


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _compile_in(processes: int) -> None:
    """Compile the kernels of all steps in a number of processes that share a cache on disk."""
    from multiprocessing import get_context

    from scanlock.interrupts import children_ignore_interrupts

    if processes < 2:
        return
    # Spawned, since a forked process would inherit the locks of the compiler.
    context = get_context("spawn")
    taken = context.Array("b", len(_steps()))
    helpers = [
        context.Process(target=run_steps, args=(number, taken), daemon=True)
        for number in range(1, processes)
    ]
    with children_ignore_interrupts():
        for helper in helpers:
            helper.start()
    run_steps(0, taken)
    for helper in helpers:
        helper.join()


def run_steps(number: int, taken: Any) -> None:
    """Run the steps that no other process has started, in the order of this process."""
    steps = _steps()
    for k in ordered(range(len(steps)), number):
        with taken.get_lock():
            is_free = not taken[k]
            taken[k] = 1
        if is_free:
            steps[k]()


def _steps() -> list[Callable[[], object]]:
    from scanlock.registration.warm_up import warm_up_steps

    return [*warm_up_steps(), _warm_up_simulation, _warm_up_files]


def ordered(steps: Sequence[_Step], number: int) -> list[_Step]:
    """Order the steps of a process: forwards if its number is even, else backwards, and shifted.

    Steps far apart share few kernels, so processes rarely compile the same kernel.
    """
    turned = list(steps if number % 2 == 0 else reversed(steps))
    first = (number // 2) * len(turned) // 3 % len(turned)
    return turned[first:] + turned[:first]


def _warm_up_simulation() -> None:
    from dataclasses import replace

    import numpy as np

    from scanlock.geometry.pose import Pose
    from scanlock.simulation import (
        HeightField,
        Mover,
        SurfaceClass,
        World,
        boxes,
        os1_64,
        simulate_scan,
    )

    box = boxes([[0.0, 0.0, 0.0]], [[1.0, 1.0, 1.0]], SurfaceClass.CAR)
    world = World.of(
        [box.moved(Pose(np.eye(3), np.array([6.0, 0.0, 0.0])))],
        HeightField(np.zeros((20, 20)), np.array([-20.0, -20.0]), 2.0),
        [
            Mover(
                surfaces=box,
                path=np.array([[0.0, 6.0, 0.0], [9.0, 6.0, 0.0]]),
                start=0.0,
                speed=1.0,
            )
        ],
    )
    above = Pose(np.eye(3), np.array([0.0, 0.0, 2.0]))
    sensor = replace(os1_64(), azimuth_steps=32)
    simulate_scan(world, sensor, above, np.random.default_rng(0))


def _warm_up_files() -> None:
    from pathlib import Path
    from tempfile import TemporaryDirectory

    import numpy as np

    from scanlock.io import read_scan, write_scan

    with TemporaryDirectory() as folder:
        path = Path(folder) / "scan.pcd"
        write_scan(path, np.arange(300.0).reshape(100, 3), encoding="compressed")
        read_scan(path)


def cache_location() -> str:
    """Return the location of the cache, or the reason why there is none and the remedy."""
    from scanlock.kernels.points import polar

    stats = getattr(polar.polar_cells, "stats", None)
    if stats is None:
        return "the compiler is off: the environment variable NUMBA_DISABLE_JIT is set"
    if stats.cache_path is None:
        return (
            "no cache folder is writable, so every run compiles again; set the "
            "environment variable NUMBA_CACHE_DIR to a writable one"
        )
    return f"cached in {stats.cache_path}"
