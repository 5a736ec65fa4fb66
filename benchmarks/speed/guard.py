"""CPU time of single stages as multiples of a fixed loop, compared with recorded multiples.

    python -m benchmarks.speed.guard [--rounds 15] [--only TEXT] [--baseline FILE] [--write]

Two simulated scans of a street; the stages and the loop run alternately on one core. A multiple
depends on the machine far less than a time does. A stage that needs more than 1.5 times the
multiple in ``guard.toml`` causes a warning, never an error, since machines differ. ``--write``
records the measured multiples.
"""

import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import numpy as np

from benchmarks._common.arguments import make_parser
from benchmarks._common.cores import pin_to_cores
from benchmarks._common.laps import run_interleaved
from benchmarks._common.results import Results
from scanlock.clouds.point_cloud import PointCloud
from scanlock.geometry.pose import Pose
from scanlock.registration.register import register
from scanlock.registration.registry import METHODS
from scanlock.segmentation.segmentation import segment
from scanlock.simulation import scan_pair

BASELINE = Path(__file__).with_suffix(".toml")

MAX_RATIO = 1.5
"""Maximum ratio to the recorded multiple without a warning."""

LOOP = "reference loop"


@numba.njit
def reference_loop(points: Any, slots: Any) -> float:
    """Hash points into slots and sum the previous values: arithmetic and memory accesses.

    All recorded multiples refer to this loop; a change here invalidates them.
    """
    total = 0.0
    for _ in range(4):
        for i in range(points.shape[0]):
            x, y, z = points[i, 0], points[i, 1], points[i, 2]
            distance = np.sqrt(x * x + y * y + z * z)
            cell = int(np.floor(x)) * 73856093 ^ int(np.floor(y)) * 19349663 ^ int(np.floor(z))
            slot = cell & (slots.shape[0] - 1)
            total += slots[slot] / (1.0 + distance)
            slots[slot] = 0.5 * slots[slot] + distance
    return total


def stages(only: str) -> dict[str, Callable[[None], object]]:
    """Return the loop and the stages with a text in the name."""
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
        prepared = [method.prepare(cloud) for cloud in clouds]
        found[f"{name}, prepare"] = lambda _: method.prepare(clouds[0])
        found[f"{name}, align"] = lambda _: method.align(prepared[0], prepared[1], Pose.identity())

    for name in ("sgc-ndt-d2d", "sgc-ndt-p2d", "gicp", "vgicp", "icp", "ndt", "ndt-d2d"):
        if only in f"{name}, prepare" or only in f"{name}, align":
            add(name)
    chosen = {name: run for name, run in found.items() if only in name}
    return {LOOP: lambda _: reference_loop(target, slots), **chosen}


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--rounds", type=int, default=15, help="maximum number of rounds")
    parser.add_argument("--only", default="", help="only stages with this text in the name")
    parser.add_argument("--baseline", type=Path, default=BASELINE, help="file like guard.toml")
    parser.add_argument("--write", action="store_true", help="record the multiples")
    arguments = parser.parse_args()
    pin_to_cores()
    results = Results(arguments.json)
    laps = run_interleaved(stages(arguments.only), [None], arguments.rounds, seconds=1.0)
    fastest = {name: min(one.cpu for one in of_stage) for name, of_stage in laps.items()}
    multiples = {name: cpu / fastest[LOOP] for name, cpu in fastest.items()}
    del multiples[LOOP]
    if arguments.write and not arguments.only:
        lines = [f'"{name}" = {multiple:.3f}' for name, multiple in multiples.items()]
        arguments.baseline.write_text("\n".join(["[multiples]", *lines, ""]))
    recorded = tomllib.loads(arguments.baseline.read_text())["multiples"]
    print(f"{results.machine_line}; the loop takes {1e3 * fastest[LOOP]:.2f} ms\n")
    rows: list[list[str]] = []
    slower: list[str] = []
    for name, multiple in multiples.items():
        ratio = multiple / recorded[name] if name in recorded else float("nan")
        slower += [name] if ratio > MAX_RATIO else []
        numbers = (multiple, recorded.get(name, float("nan")), ratio)
        rows.append([name, f"{1e3 * fastest[name]:.2f}", *(f"{one:.2f}" for one in numbers)])
    results.add_table(("stage", "CPU ms, minimum", "in loops", "recorded", "ratio"), rows)
    for name in slower:
        print(f"warning: {name} takes more than {MAX_RATIO:g} times as long as recorded")


if __name__ == "__main__":
    main()
