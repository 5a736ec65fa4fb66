"""Has a stage become slower? Its time as a multiple of that of a loop that never changes.

    python benchmarks/guard.py [--rounds 15] [--only TEXT] [--kept FILE] [--write]

Two simulated scans of a street; every stage and the loop turn about, on one core. A multiple
depends little on the machine, which seconds do not. It is compared with the one in ``guard.toml``:
more than half as much again gets a warning. Never fails for it, since machines do differ;
``--write`` keeps what was measured.
"""

import argparse
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import numpy as np

from cores import hold_to_cores
from laps import turn_about
from scanlock.clouds.point_cloud import PointCloud
from scanlock.geometry.pose import Pose
from scanlock.registration.register import register
from scanlock.registration.registry import METHODS
from scanlock.segmentation.segmentation import segment
from scanlock.simulation import scan_pair
from tables import machine, print_table

KEPT = Path(__file__).with_suffix(".toml")

SLOWER = 1.5
"""Times the kept multiple, above which a stage gets a warning."""

THE_LOOP = "the loop"


@numba.njit
def the_loop(points: Any, slots: Any) -> float:
    """Hash points into slots and sum what was there before: some arithmetic, some memory.

    Every kept multiple is of this: a change here makes all of them worthless.
    """
    total = 0.0
    for _ in range(4):
        for i in range(points.shape[0]):
            x, y, z = points[i, 0], points[i, 1], points[i, 2]
            reach = np.sqrt(x * x + y * y + z * z)
            cell = int(np.floor(x)) * 73856093 ^ int(np.floor(y)) * 19349663 ^ int(np.floor(z))
            slot = cell & (slots.shape[0] - 1)
            total += slots[slot] / (1.0 + reach)
            slots[slot] = 0.5 * slots[slot] + reach
    return total


def stages(only: str) -> dict[str, Callable[[None], object]]:
    """Return what is measured, by names that contain a text."""
    pair = scan_pair("street", "hdl_64e", 0)
    source, target = (np.array(one.points) for one in (pair.source, pair.target))
    clouds = [PointCloud.from_array(points) for points in (target, source)]
    slots = np.zeros(1 << 16)
    found: dict[str, Callable[[None], object]] = {
        "check": lambda _: PointCloud.from_array(target),
        "segment": lambda _: segment(target),
        "register": lambda _: register(source=source, target=target),
    }

    def add(name: str) -> None:
        method = METHODS[name]
        kept = [method.prepare(cloud) for cloud in clouds]
        found[f"{name}, prepare"] = lambda _: method.prepare(clouds[0])
        found[f"{name}, align"] = lambda _: method.align(kept[0], kept[1], Pose.identity())

    for name in ("sgc-ndt-d2d", "sgc-ndt-p2d", "gicp", "vgicp", "icp", "ndt", "ndt-d2d"):
        if only in f"{name}, prepare" or only in f"{name}, align":
            add(name)
    chosen = {name: run for name, run in found.items() if only in name}
    return {THE_LOOP: lambda _: the_loop(target, slots), **chosen}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=15, help="at most")
    parser.add_argument("--only", default="", help="stages whose name contains this text")
    parser.add_argument("--kept", type=Path, default=KEPT, help="a file like guard.toml")
    parser.add_argument("--write", action="store_true", help="keep what is measured")
    arguments = parser.parse_args()
    hold_to_cores()
    laps = turn_about(stages(arguments.only), [None], arguments.rounds, seconds=1.0)
    fastest = {name: min(one.cpu for one in of_stage) for name, of_stage in laps.items()}
    multiples = {name: cpu / fastest[THE_LOOP] for name, cpu in fastest.items()}
    del multiples[THE_LOOP]
    if arguments.write and not arguments.only:
        lines = [f'"{name}" = {multiple:.3f}' for name, multiple in multiples.items()]
        arguments.kept.write_text("\n".join(["[multiples]", *lines, ""]))
    kept = tomllib.loads(arguments.kept.read_text())["multiples"]
    print(machine(), f"; the loop takes {1e3 * fastest[THE_LOOP]:.2f} ms", "\n", sep="")
    rows: list[list[str]] = []
    slower: list[str] = []
    for name, multiple in multiples.items():
        change = multiple / kept[name] if name in kept else float("nan")
        slower += [name] if change > SLOWER else []
        numbers = (multiple, kept.get(name, float("nan")), change)
        rows.append([name, f"{1e3 * fastest[name]:.2f}", *(f"{one:.2f}" for one in numbers)])
    print_table(("stage", "CPU ms, fastest", "in loops", "kept", "times the kept"), rows)
    for name in slower:
        print(f"warning: {name} takes more than {SLOWER:g} times as long as it did")


if __name__ == "__main__":
    main()
