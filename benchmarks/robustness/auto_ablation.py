"""Ablation of the default method: the same pairs with single stages switched off.

    python -m benchmarks.robustness.auto_ablation --data FOLDER [--headings 1] [--pairs 12]
        [--only TEXT]

Real pairs at random headings, as in `any_start`, and simulated pairs 20 to 40 m apart (solved
within 0.5 m and 1 degree), where one stage cannot compensate for another. No initial pose. Cells
count the solved pairs. The last columns hold the median errors on the pairs of the city drive ten
scans apart, which have the best reference, and the median CPU time of a call.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._common import real_scans
from benchmarks._common.arguments import make_parser
from benchmarks._common.contenders import Contender, scanlock_contender
from benchmarks._common.far_pairs import far_pairs
from benchmarks._common.results import Results
from benchmarks._common.trials import Trial, run_trial
from benchmarks._common.turned_pairs import headings, tolerance_of
from scanlock.geometry.pose import Pose
from scanlock.registration.methods.auto.auto import Auto
from scanlock.registration.methods.auto.multi_start import MultiStart
from scanlock.registration.methods.coarse_to_fine import DEFAULT_SCALES
from scanlock.registration.methods.fine_ndt import FineNdt
from scanlock.registration.search.bev_correlation import BevSearch

_FULL = Auto()

_NO_FALLBACK = replace(_FULL, fallback_search=None, matcher=None)

_LATE_ENTRY = tuple(replace(scale, starts_here=False) for scale in DEFAULT_SCALES[2:])

VARIANTS: dict[str, Auto] = {
    "default": _FULL,
    "no fallback": _NO_FALLBACK,
    "... and no free cells": replace(_NO_FALLBACK, search=BevSearch(free_cell_weight=0.0)),
    "... and no whitening": replace(_NO_FALLBACK, search=BevSearch(whitening=0.0)),
    "... and only the first hypothesis": replace(_NO_FALLBACK, search=BevSearch(max_hypotheses=1)),
    "... and no ground alignment": replace(_NO_FALLBACK, search=BevSearch(align_ground=False)),
    "... and no free-space check": replace(_NO_FALLBACK, range_imager=None),
    "... and entry at 2 m": replace(_NO_FALLBACK, multi_start=MultiStart(scales=_LATE_ENTRY)),
    "cluster matching instead of BEV search": replace(_FULL, search=None, fallback_search=None),
    "no global search": replace(_NO_FALLBACK, search=None),
    "no fine stage": replace(_FULL, fine=None),
    "fine stage on one grid": replace(_FULL, fine=FineNdt(offsets=(0.0,))),
    "fine stage, voxels of 0.5 m": replace(_FULL, fine=FineNdt(cell_sizes=(0.5, 1.0, 2.0, 4.0))),
    "fine stage, voxels of 2 m": replace(_FULL, fine=FineNdt(cell_sizes=(2.0, 4.0))),
}

BASELINES = ((20.0, 30.0), (30.0, 40.0))
"""Distances of the simulated pairs [m]."""


@dataclass(frozen=True)
class Task:
    """Two scans with the true pose, and the column that counts them."""

    column: str
    target: Any
    source: Any
    truth: Pose
    tolerance: tuple[float, float]


def real_tasks(data: Path, count: int) -> Iterator[Task]:
    """Yield the real pairs: difficult ones, and those with the best reference."""
    columns = {
        "city, 10 apart": list(real_scans.kitti_drive(data, 10))[::2],
        "city, far": [
            *(pair for step in (30, 45, 55) for pair in real_scans.kitti_drive_far(data, step)),
            *(pair for step in (10, 15) for pair in real_scans.kitti_00(data, step)),
        ],
        "handheld, 10": list(real_scans.handheld(data, 10)),
        "handheld, 15": list(real_scans.handheld(data, 15)),
        "handheld, 20": list(real_scans.handheld(data, 20)),
        "others": [
            pair
            for make in (real_scans.forest, real_scans.hdl32, real_scans.argoverse,
                         real_scans.newer_college, real_scans.car_cloud, real_scans.rellis)
            for pair in make(data)
        ],
    }  # fmt: skip
    for column, pairs in columns.items():
        for index, pair in enumerate(pairs):
            source = pair.load_source()
            for turn in headings(pair.group, index, count):
                yield Task(
                    column, pair.load_target(), turn.apply(source), pair.truth @ turn.inverse(),
                    tolerance_of(pair.group),
                )  # fmt: skip


def far_tasks(count: int) -> Iterator[Task]:
    """Yield the simulated pairs."""
    for kind in ("street", "forest"):
        for seed in range(count):
            for baseline, pair in far_pairs(kind, seed, BASELINES):
                yield Task(
                    f"{kind}, {baseline[0]:g}-{baseline[1]:g} m", pair.target.points,
                    pair.source.points, pair.target_from_source, (0.5, 1.0),
                )  # fmt: skip


def main() -> None:
    parser = make_parser(__doc__, data=True)
    parser.add_argument("--headings", type=int, default=1, help="headings per real pair")
    parser.add_argument("--pairs", type=int, default=12, help="scenes per simulated kind")
    parser.add_argument("--only", default="", help="only variants with this text in the name")
    arguments = parser.parse_args()
    results = Results(arguments.json)
    results.print_machine()
    tasks = [*real_tasks(arguments.data, arguments.headings), *far_tasks(arguments.pairs)]
    columns = list(dict.fromkeys(task.column for task in tasks))

    def row(name: str, method: Auto) -> list[str]:
        contender = scanlock_contender(name, method)
        contender.register(tasks[0].source, tasks[0].target, None)
        return [name, *cells(contender, tasks, columns)]

    results.add_table(
        ("variant", *columns, "city, median", "CPU ms"),
        (row(name, method) for name, method in VARIANTS.items() if arguments.only in name),
        title="variants of auto",
    )


def cells(contender: Contender, tasks: list[Task], columns: list[str]) -> list[str]:
    """Return solved pairs by column, median errors and CPU time."""
    found: list[tuple[Task, Trial]] = [
        (task, run_trial(contender, task.source, task.target, task.truth, task.tolerance))
        for task in tasks
    ]
    texts: list[str] = []
    for column in columns:
        solved = [one.solved for task, one in found if task.column == column]
        texts.append(f"{sum(solved)} / {len(solved)}")
    city = [one for task, one in found if task.column == "city, 10 apart"]
    metres = float(np.median([one.metres for one in city]))
    degrees = float(np.median([one.degrees for one in city]))
    seconds = float(np.median([one.seconds for _, one in found]))
    return [*texts, f"{100 * metres:.2f} cm, {degrees:.3f}°", f"{1e3 * seconds:.0f}"]


if __name__ == "__main__":
    main()
