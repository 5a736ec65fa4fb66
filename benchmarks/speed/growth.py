"""CPU time and memory by the number of points, the extent and the range of the scans.

    python -m benchmarks.speed.growth [--methods auto sgc-ndt-d2d gicp ndt-d2d]
        [--max-points 3000000] [--series denser wider farther] [--figure FILE]

Two simulated scans of a street (HDL-64E, 3 to 5 m apart), from the identity, as float64 arrays:

- denser: rows removed, or points added between neighbours;
- wider: several streets on a grid of 150 m, as in a map;
- farther: points within a range.

Each size runs in a new process on one core. CPU time is the median of up to three calls after a
first. Memory is the peak of the resident size during the first call minus the size before it
(Linux). Exponents are slopes of a line through the logarithms, over sizes of at least
``--min-points`` points.
"""

import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._common.arguments import make_parser
from benchmarks._common.cores import pin_to_cores
from benchmarks._common.results import Results
from scanlock.simulation import SimulatedPair, scan_pair

Cloud = np.ndarray
Size = tuple[float, Cloud, Cloud]
Measured = dict[str, Any]

TILE = 150.0
TILES = (1, 3, 9, 24, 80)
RANGES = (10.0, 20.0, 40.0, 80.0, 120.0)
COUNTS = (10_000, 30_000, 100_000, 300_000, 1_000_000, 3_000_000, 10_000_000)
NOISE = 0.02

CHILD = """
import json, sys, time
time.perf_counter = time.process_time  # the times of the stages are then CPU time
import numpy as np
import scanlock
method, *names = sys.argv[1:]
source, target = (np.load(name) for name in names)
sparse = [cloud[:: max(1, len(cloud) // 20_000)] for cloud in (source, target)]
scanlock.register(source=sparse[0], target=sparse[1], method=method)
def memory(kind):
    lines = open("/proc/self/status").read().splitlines()
    return 1024 * next(int(line.split()[1]) for line in lines if line.startswith(kind))
before = memory("VmRSS")
open("/proc/self/clear_refs", "w").write("5")
calls = []
while len(calls) < 2 or len(calls) < 4 and sum(cpu for cpu, _ in calls) < 2.0:
    begin = time.process_time()
    result = scanlock.register(source=source, target=target, method=method)
    calls.append((time.process_time() - begin, dict(result.timings)))
    if len(calls) == 1:
        peak = memory("VmHWM")
del calls[0]  # includes the allocation of memory
cpu = float(np.median([cpu for cpu, _ in calls]))
stages = {name: float(np.median([one[name] for _, one in calls])) for name in calls[0][1]}
prepared = scanlock.prepare(target, method=method)
clusters = 0 if prepared.features is None else len(prepared.features.gaussians)
print(json.dumps(dict(cpu=cpu, stages=stages, extra=max(0, peak - before), clusters=clusters,
                      evaluations=result.iterations, ok=result.ok)))
"""


def denser(points: Cloud, count: int, rng: np.random.Generator) -> Cloud:
    """Return a cloud with the given number of points."""
    if count <= len(points):
        return points[np.sort(rng.choice(len(points), count, replace=False))]
    rows = rng.integers(0, len(points) - 1, count - len(points))
    steps = points[rows + 1] - points[rows]
    steps[np.linalg.norm(steps, axis=1) > 0.5] = 0.0
    between = points[rows] + rng.uniform(0.0, 1.0, (len(rows), 1)) * steps
    return np.concatenate([points, between + rng.normal(0.0, NOISE, between.shape)])


def wider(tiles: int) -> tuple[Cloud, Cloud]:
    """Return the source and the target of several streets side by side."""
    side = int(np.ceil(np.sqrt(tiles)))
    back = street(0).target_from_source.inverse()
    sources: list[Cloud] = []
    targets: list[Cloud] = []
    for tile in range(tiles):
        pair, shift = street(tile), TILE * np.array([*divmod(tile, side), 0.0])
        placed = pair.target_from_source.apply(pair.source.points)
        sources.append(back.apply(placed + shift))
        targets.append(pair.target.points + shift)
    return np.concatenate(sources), np.concatenate(targets)


@cache
def street(seed: int) -> SimulatedPair:
    """Return two scans of one street."""
    return scan_pair("street", "hdl_64e", seed)


def sizes(series: str, max_points: int) -> Iterator[Size]:
    """Yield the size, the source and the target."""
    source, target = street(0).source.points, street(0).target.points
    rng = np.random.default_rng(0)
    if series == "denser":
        for count in COUNTS:
            if count <= max_points:
                yield count, denser(source, count, rng), denser(target, count, rng)
    elif series == "wider":
        for tiles in TILES:
            if tiles * len(target) <= max_points:
                wide = wider(tiles)
                yield len(wide[1]), *wide
    else:
        for max_range in RANGES:
            near = [one[np.linalg.norm(one, axis=1) < max_range] for one in (source, target)]
            yield max_range, near[0], near[1]


def measured(method: str, source: Cloud, target: Cloud, folder: Path) -> Measured:
    """Return time and memory of one registration in a new process."""
    names = [str(folder / "source.npy"), str(folder / "target.npy")]
    for name, points in zip(names, (source, target), strict=True):
        np.save(name, points)
    done = subprocess.run(
        [sys.executable, "-c", CHILD, method, *names], capture_output=True, text=True, check=True
    )
    found: Measured = json.loads(done.stdout)
    return found | {"points": len(target), "bytes": source.nbytes + target.nbytes}


def slope(sizes: Sequence[float], values: Sequence[float]) -> float:
    """Return the exponent of a power law through the values."""
    if len(sizes) < 2 or min(values) <= 0.0:
        return float("nan")
    return float(np.polyfit(np.log(sizes), np.log(values), 1)[0])


def stage_seconds(one: Measured) -> dict[str, float]:
    """Return the CPU time of preparation, alignment, verification and single stages [s]."""
    stages = dict(one["stages"])
    total, align, verify = (stages.pop(name, 0.0) for name in ("total", "align", "verification"))
    return {"prepare": total - align - verify, "align": align, "verify": verify, **stages}


def add_series(
    results: Results, series: str, found: Mapping[str, Mapping[float, Measured]]
) -> None:
    """Add the table of one series."""
    label = "range m" if series == "farther" else "points"
    columns = [
        "method", label, "CPU ms", "prepare", "align", "verify", "clusters", "evaluations",
        "memory MB", "relative to the input", "ok",
    ]  # fmt: skip
    rows: list[list[str]] = []
    for method, by_size in found.items():
        for size, one in by_size.items():
            seconds = stage_seconds(one)
            rows.append(
                [
                    method,
                    f"{size:,.0f}",
                    f"{1e3 * one['cpu']:.0f}",
                    *(f"{1e3 * seconds[name]:.0f}" for name in ("prepare", "align", "verify")),
                    str(one["clusters"]),
                    str(one["evaluations"]),
                    f"{one['extra'] / 1e6:.0f}",
                    f"{one['extra'] / one['bytes']:.1f}",
                    "yes" if one["ok"] else "no",
                ]
            )
    results.add_table(columns, rows, title=f"growth, {series}")


def add_exponents(
    results: Results,
    series: str,
    found: Mapping[str, Mapping[float, Measured]],
    min_points: int,
) -> None:
    """Add the exponents over the number of points, and the stages with steeper ones."""
    quantities: dict[str, Callable[[Measured], float]] = {
        "CPU": lambda one: one["cpu"],
        "prepare": lambda one: stage_seconds(one)["prepare"],
        "align": lambda one: stage_seconds(one)["align"],
        "memory": lambda one: one["extra"],
        "clusters": lambda one: one["clusters"],
    }
    rows: list[list[str]] = []
    for method, by_size in found.items():
        large = [one for one in by_size.values() if one["points"] >= min_points]
        if len(large) < 2:
            continue
        points = [one["points"] for one in large]
        cells = [f"{slope(points, [of(one) for one in large]):.2f}" for of in quantities.values()]
        steep: list[str] = []
        for name in stage_seconds(large[-1]):
            seconds = [stage_seconds(one).get(name, 0.0) for one in large]
            exponent = slope(points, seconds)
            if exponent > 1.1 and seconds[-1] > 0.02 * large[-1]["cpu"]:
                steep.append(f"{name} {exponent:.2f} ({1e3 * seconds[-1]:.0f} ms)")
        rows.append([method, *cells, ", ".join(steep) or "none"])
    if rows:
        columns = ("method", *quantities, "steeper than 1.1 (at the last size)")
        results.add_table(columns, rows, title=f"exponents, {series}")


def draw(found: Mapping[str, Mapping[str, Mapping[float, Measured]]], path: Path) -> None:
    """Write a figure of CPU time by size."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.5 * len(found), 4.0), layout="constrained")
    for axes, (series, methods) in zip(figure.subplots(1, len(found), squeeze=False)[0],
                                       found.items(), strict=True):  # fmt: skip
        for method, by_size in methods.items():
            axes.loglog(list(by_size), [one["cpu"] for one in by_size.values()], "o-", label=method)
        axes.set(title=series, xlabel="range [m]" if series == "farther" else "points per scan",
                 ylabel="CPU time of a registration [s]")  # fmt: skip
        axes.grid(which="both", alpha=0.3)
        axes.legend()
    figure.savefig(path)


def main() -> None:
    parser = make_parser(__doc__)
    default = ["auto", "sgc-ndt-d2d", "gicp", "ndt-d2d"]
    parser.add_argument("--methods", nargs="+", default=default)
    parser.add_argument("--series", nargs="+", default=["denser", "wider", "farther"])
    parser.add_argument("--max-points", type=int, default=3_000_000, help="points of a scan")
    parser.add_argument("--min-points", type=int, default=100_000, help="for exponents")
    parser.add_argument("--figure", type=Path, help="write a figure")
    arguments = parser.parse_args()
    pin_to_cores()
    results = Results(arguments.json)
    results.print_machine()
    found: dict[str, dict[str, dict[float, Measured]]] = {}
    with tempfile.TemporaryDirectory() as name:
        for series in arguments.series:
            found[series] = {method: {} for method in arguments.methods}
            for size, source, target in sizes(series, arguments.max_points):
                for method in arguments.methods:
                    one = measured(method, source, target, Path(name))
                    found[series][method][size] = one
            add_series(results, series, found[series])
            if series != "farther":
                add_exponents(results, series, found[series], arguments.min_points)
    if arguments.figure:
        draw(found, arguments.figure)


if __name__ == "__main__":
    main()
