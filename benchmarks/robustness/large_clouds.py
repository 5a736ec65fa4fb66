"""Clouds that are large, wide or cluttered: pose, time and peak memory of `auto` without a start.

    python -m benchmarks.robustness.large_clouds [--only TEXT]

- uniform: two clouds of random points in a box, which have no pose;
- mosaic: forest scans of OS1-64 side by side over 1.4 km, from two positions each, as two maps;
- clutter: two scans of HDL-64E, each with as many random points in the box around it;
- turned: two such scans whose x axis is up, without clutter.

Each case runs in a new process on one core. Memory is the peak of the resident size during the
call minus the size before it, as a multiple of the two float64 arrays (Linux). The process may
take ``--limit`` GiB.
"""

import json
import subprocess
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._common.arguments import make_parser
from benchmarks._common.contenders import Cloud, pose_error
from benchmarks._common.cores import pin_to_cores
from benchmarks._common.results import Results
from scanlock.geometry.pose import Pose
from scanlock.simulation import scan_pair

Case = tuple[Cloud, Cloud, Pose | None]
"""Source, target, and the pose of the source in the target if there is one."""

CHILD = """
import json, resource, sys, time
import numpy as np
import scanlock
limit = int(float(sys.argv[1]) * 2**30)
source, target = (np.load(name) for name in sys.argv[2:])
sparse = [cloud[:: max(1, len(cloud) // 20_000)] for cloud in (source, target)]
scanlock.register(source=sparse[0], target=sparse[1])
resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
def memory(kind):
    lines = open("/proc/self/status").read().splitlines()
    return 1024 * next(int(line.split()[1]) for line in lines if line.startswith(kind))
before = memory("VmRSS")
open("/proc/self/clear_refs", "w").write("5")
begin = time.process_time()
result = scanlock.register(source=source, target=target)
seconds = time.process_time() - begin
extra = memory("VmHWM") - before
print(json.dumps(dict(seconds=seconds, ratio=extra / (source.nbytes + target.nbytes),
                      ok=result.ok, pose=result.target_from_source.matrix.tolist(),
                      stages=dict(result.timings))))
"""


def uniform(count: int, side: float) -> Case:
    """Return two clouds of points that are uniform in a cube."""
    rng = np.random.default_rng(1)
    source, target = (rng.uniform(-0.5 * side, 0.5 * side, (count, 3)) for _ in range(2))
    return source, target, None


def mosaic(tiles: int, side: float) -> Case:
    """Return two maps of the same forest plots; each has its own scan of every plot."""
    maps: tuple[list[Cloud], list[Cloud]] = [], []
    for seed in range(tiles**2):
        pair = scan_pair("forest", "os1_64", seed=seed)
        at = np.array([seed // tiles, seed % tiles, 0.0]) * side / tiles
        maps[0].append(pair.target_from_source.apply(pair.source.points) + at)
        maps[1].append(pair.target.points + at)
    known = Pose.from_step(np.array([3.0, -2.0, 0.3, 0.0, 0.0, 0.5]))
    return known.inverse().apply(np.vstack(maps[0])), np.vstack(maps[1]), known


def clutter(seed: int) -> Case:
    """Return a pair of scans of a street with as many random points as measured ones."""
    pair = scan_pair("street", "hdl_64e", seed=seed)
    rng = np.random.default_rng(seed)
    clouds: list[Cloud] = []
    for points in (pair.source.points, pair.target.points):
        noise = rng.uniform(np.percentile(points, 2, axis=0), np.percentile(points, 98, axis=0),
                            points.shape)  # fmt: skip
        clouds.append(np.vstack([points, noise]))
    return clouds[0], clouds[1], pair.target_from_source


def turned(seed: int) -> Case:
    """Return a pair of scans of a street whose x axis is up."""
    pair = scan_pair("street", "hdl_64e", seed=seed)
    turn = Pose.from_step(np.array([0.0, 0.0, 0.0, 0.0, 0.5 * np.pi, 0.0]))
    source, target = (turn.apply(one.points) for one in (pair.source, pair.target))
    return source, target, turn @ pair.target_from_source @ turn.inverse()


CASES: dict[str, Callable[[], Case]] = {
    "uniform, 1 million in 100 m": partial(uniform, 1_000_000, 100.0),
    "uniform, 5 million in 100 m": partial(uniform, 5_000_000, 100.0),
    "uniform, 5 million in 400 m": partial(uniform, 5_000_000, 400.0),
    "mosaic of forests over 1.4 km": partial(mosaic, 6, 1400.0),
    "clutter, first street": partial(clutter, 1),
    "clutter, second street": partial(clutter, 2),
    "turned, first street": partial(turned, 1),
    "turned, second street": partial(turned, 2),
}


def measure(case: Case, limit: float) -> dict[str, Any] | str:
    """Return what the child process measures, or the last line of its error."""
    with tempfile.TemporaryDirectory() as folder:
        names = [str(Path(folder) / name) for name in ("source.npy", "target.npy")]
        for name, cloud in zip(names, case, strict=False):
            np.save(name, cloud)
        command = [sys.executable, "-c", CHILD, str(limit), *names]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        return (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
    return json.loads(done.stdout)


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--only", default="", help="only cases with this text in the name")
    parser.add_argument("--limit", type=float, default=12.0, help="memory of a process [GiB]")
    parser.add_argument("--stages", action="store_true", help="print the times of the stages")
    arguments = parser.parse_args()
    pin_to_cores()
    rows: list[tuple[str, ...]] = []
    for name, make in CASES.items():
        if arguments.only not in name:
            continue
        case = make()
        found = measure(case, arguments.limit)
        count = f"{len(case[0]):,} + {len(case[1]):,}"
        if isinstance(found, str):
            rows.append((name, count, found, "-", "-", "-"))
            continue
        if arguments.stages:
            print(name, {stage: round(one, 2) for stage, one in found["stages"].items()})
        error = "-"
        if case[2] is not None:
            metres, degrees = pose_error(Pose.from_matrix(found["pose"]), case[2])
            error = f"{metres:.3f} m, {degrees:.2f}°"
        claimed = "yes" if found["ok"] else "no"
        rows.append(
            (name, count, f"{found['seconds']:.1f}", f"{found['ratio']:.1f}", error, claimed)
        )
    results = Results(arguments.json)
    results.add_table(
        ("clouds", "points", "CPU s", "memory / input", "error", "called ok"), rows,
        title="large, wide or cluttered clouds",
    )  # fmt: skip
    results.print_machine()


if __name__ == "__main__":
    main()
