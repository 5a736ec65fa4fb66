"""``scanlock warmup``: everything that is compiled, compiled now."""

import time


def warm_up() -> None:
    """Compile everything now and keep it on disk, so that no later command has to."""
    from scanlock.cli.compiling import compile_watch
    from scanlock.cli.screen import print_line, waiting
    from scanlock.registration.warm_up import warm_up as warm_up_registration

    begin = time.perf_counter()
    with compile_watch() as watch, waiting("compiling"):
        warm_up_registration()
        _warm_up_simulation()
        _warm_up_files()
    seconds = time.perf_counter() - begin
    if watch.compiled:
        print_line(f"compiled everything in {seconds:.0f} s; commands now start at once")
    else:
        print_line(f"everything was compiled already; loaded it in {seconds:.1f} s")
    print_line(where_it_is_kept())


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
        [Mover(box, np.array([[0.0, 6.0, 0.0], [9.0, 6.0, 0.0]]), 0.0, 1.0)],
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


def where_it_is_kept() -> str:
    """Return where the machine code lies on disk, or why nowhere and what to do about it."""
    from scanlock.kernels import polar

    stats = getattr(polar.polar_cells, "stats", None)
    if stats is None:
        return "the compiler is off: the environment variable NUMBA_DISABLE_JIT is set"
    if stats.cache_path is None:
        return (
            "no folder to keep it in is writable, so every run compiles anew; set the "
            "environment variable NUMBA_CACHE_DIR to one that is"
        )
    return f"kept in {stats.cache_path}"
