"""CPU time of one pair of 120k-point scans, raw arrays to pose, split by stage.

    python benchmarks/timing.py --data FOLDER [--repeats 20] [--start near|identity]

Five pairs of a city drive, ten scans apart; each method in turn, pair by pair, after warm-up,
and the median over all. ``near`` starts 0.5 m and 2 degrees from the truth, where every method
converges; from the identity (3 to 4 m, 7 to 11 degrees) some peers only spend time. Peers get the
same raw float64 arrays. The ratio is to scanlock's default in the same run.
"""

import argparse
import os
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

import numpy as np

from basin import random_start
from contenders import Cloud
from real_scans import kitti_drive
from scanlock.geometry.pose import Pose
from scanlock.registration.methods import DEFAULT_METHOD, METHODS
from scanlock.registration.register import register
from tables import machine, print_table

Stages = dict[str, float]
Run = Callable[[Cloud, Cloud, Pose], Stages]


def ours(method: str) -> Run:
    def run(source: Cloud, target: Cloud, start: Pose) -> Stages:
        timings = dict(register(source, target, method=method, initial=start).timings)
        del timings["total"]
        return timings

    return run


def small_gicp_run(kind: str) -> Run:
    import small_gicp

    def run(source: Cloud, target: Cloud, start: Pose) -> Stages:
        begin = time.perf_counter()
        target_cloud, tree = small_gicp.preprocess_points(target, downsampling_resolution=0.25)
        source_cloud, _ = small_gicp.preprocess_points(source, downsampling_resolution=0.25)
        prepared = time.perf_counter()
        if kind == "VGICP":
            voxels = small_gicp.GaussianVoxelMap(1.0)
            voxels.insert(target_cloud)
            small_gicp.align(voxels, source_cloud, start.matrix)
        else:
            small_gicp.align(target_cloud, source_cloud, tree, start.matrix)
        return {"prepare": prepared - begin, "align": time.perf_counter() - prepared}

    return run


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=os.environ.get("SCANLOCK_DATA"))
    parser.add_argument("--repeats", type=int, default=20, help="rounds over the five pairs")
    parser.add_argument("--start", choices=("near", "identity"), default="near")
    arguments = parser.parse_args()
    if arguments.data is None:
        parser.error("give --data FOLDER or set SCANLOCK_DATA")
    runs = {f"scanlock {method}": ours(method) for method in METHODS}
    runs |= {f"small_gicp {kind}": small_gicp_run(kind) for kind in ("GICP", "VGICP")}
    rng = np.random.default_rng(0)
    pairs: list[tuple[Cloud, Cloud, Pose]] = []
    for pair in list(kitti_drive(arguments.data, 10))[::11]:
        near = random_start(pair.truth, 0.5, 2.0, "vertical", rng)
        start = near if arguments.start == "near" else Pose.identity()
        pairs.append((pair.load_source(), pair.load_target(), start))
    for run in runs.values():
        run(*pairs[0])

    cpu: dict[str, list[float]] = defaultdict(list)
    stages: dict[str, list[Stages]] = defaultdict(list)
    for _ in range(arguments.repeats):
        for pair in pairs:
            for name, run in runs.items():
                begin = time.process_time()
                stages[name].append(run(*pair))
                cpu[name].append(time.process_time() - begin)

    unit = float(np.median(cpu[f"scanlock {DEFAULT_METHOD}"]))
    print(machine(), "\n")
    rows: list[tuple[str, ...]] = []
    for name, seconds in cpu.items():
        total = float(np.median(seconds))
        split = ", ".join(
            f"{stage} {1e3 * np.median([one[stage] for one in stages[name]]):.1f}"
            for stage in stages[name][0]
        )
        rows.append((name, f"{1e3 * total:.0f}", f"{total / unit:.2f}", split))
    print_table(("method", "CPU ms", "ratio", "wall ms a stage"), rows)


if __name__ == "__main__":
    main()
