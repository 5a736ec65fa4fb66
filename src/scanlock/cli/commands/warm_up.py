"""``scanlock warmup``: compile all kernels."""

import time


def warm_up() -> None:
    """Compile all kernels and cache them on disk, so that later commands start at once."""
    from scanlock.cli.compile_notice import compile_watch
    from scanlock.cli.console import print_line
    from scanlock.registration.compile_ahead import missing_kernels

    begin = time.perf_counter()
    with compile_watch(missing=lambda: missing_kernels(default_only=False)) as watch:
        run_all()
    seconds = time.perf_counter() - begin
    if watch.compiled:
        print_line(f"compiled everything in {seconds:.0f} s; commands now start at once")
    else:
        print_line(f"everything was compiled already; loaded it in {seconds:.1f} s")
    print_line(cache_location())


def run_all() -> None:
    """Call every kernel."""
    from scanlock.registration.warm_up import warm_up as warm_up_registration

    warm_up_registration()
    _warm_up_simulation()
    _warm_up_files()


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
