"""What each part of the default method is worth: the same pairs with single parts turned off.

    python benchmarks/parts.py --data FOLDER [--headings 1] [--pairs 12] [--only TEXT]

Real pairs with random headings, as any_start.py makes them, and simulated ones 20 to 40 m apart, as
far_pairs.py makes them (within 0.5 m and 1 degree here); farther apart than there, for on nearer
pairs one part makes up for the lack of another. No initial pose. A cell holds how many are solved;
then the median errors over the pairs ten scans apart of the city drive, whose reference is the
best, and the median CPU time of one whole call.
"""

import argparse
import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import real_scans
from any_start import headings, tolerance_of
from contenders import Contender, ours
from far_pairs import far_pair
from scanlock.geometry.pose import Pose
from scanlock.registration.methods.auto import Auto
from scanlock.registration.methods.coarse_to_fine import DEFAULT_SCALES
from scanlock.registration.methods.fine_ndt import FineNdt
from scanlock.registration.methods.multi_start import MultiStart
from scanlock.registration.search.bev_correlation import BevSearch
from tables import machine, print_table
from trials import Trial, tried

_FULL = Auto()

_SHALLOW = replace(_FULL, fallback_search=None, matcher=None)

_NEAR_LEADING = tuple(replace(scale, starts_here=False) for scale in DEFAULT_SCALES[2:])

VARIANTS: dict[str, Auto] = {
    "all parts": _FULL,
    "nothing tried in doubt": _SHALLOW,
    "... and open ground says nothing": replace(_SHALLOW, search=BevSearch(free_cell_weight=0.0)),
    "... and no whitening": replace(_SHALLOW, search=BevSearch(whitening=0.0)),
    "... and only the first hypothesis": replace(_SHALLOW, search=BevSearch(max_hypotheses=1)),
    "... and not laid on the ground": replace(_SHALLOW, search=BevSearch(align_ground=False)),
    "... and no free space": replace(_SHALLOW, range_imager=None),
    "... and near parts lead, from 2 m": replace(
        _SHALLOW, multi_start=MultiStart(scales=_NEAR_LEADING)
    ),
    "matched clusters, no search": replace(_FULL, search=None, fallback_search=None),
    "neither: the identity's basin": replace(_SHALLOW, search=None),
    "no fine stage": replace(_FULL, fine=None),
    "fine stage on one grid": replace(_FULL, fine=FineNdt(offsets=(0.0,))),
    "fine stage, cells of 0.5 m": replace(_FULL, fine=FineNdt(cell_sizes=(0.5, 1.0, 2.0, 4.0))),
    "fine stage, cells of 2 m": replace(_FULL, fine=FineNdt(cell_sizes=(2.0, 4.0))),
}

BASELINES = ((20.0, 30.0), (30.0, 40.0))
"""Of the simulated pairs [m]."""


@dataclass(frozen=True)
class Task:
    """Two scans and the pose between them."""

    column: str
    target: Any
    source: Any
    truth: Pose
    tolerance: tuple[float, float]


def real_tasks(data: Path, count: int) -> Iterator[Task]:
    """Yield the pairs on which parts can be told apart, and those with the best reference."""
    columns = {
        "city, 10 apart": list(real_scans.kitti_drive(data, 10))[::2],
        "city, far": [
            *(pair for apart in (30, 45, 55) for pair in real_scans.kitti_drive_far(data, apart)),
            *(pair for apart in (10, 15) for pair in real_scans.kitti_00(data, apart)),
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
    for kind in ("street", "forest"):
        for seed in range(count):
            for baseline, pair in far_pair(kind, seed, BASELINES):
                yield Task(
                    f"{kind}, {baseline[0]:g}-{baseline[1]:g} m", pair.target.points,
                    pair.source.points, pair.target_from_source, (0.5, 1.0),
                )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=os.environ.get("SCANLOCK_DATA"))
    parser.add_argument("--headings", type=int, default=1, help="headings of each real pair")
    parser.add_argument("--pairs", type=int, default=12, help="scenes of each simulated kind")
    parser.add_argument("--only", default="", help="variants whose name contains this text")
    arguments = parser.parse_args()
    if arguments.data is None:
        parser.error("give --data FOLDER or set SCANLOCK_DATA")
    tasks = [*real_tasks(arguments.data, arguments.headings), *far_tasks(arguments.pairs)]
    columns = list(dict.fromkeys(task.column for task in tasks))
    rows: list[list[str]] = []
    for name, method in VARIANTS.items():
        if arguments.only not in name:
            continue
        contender = ours(name, method)
        contender.register(tasks[0].source, tasks[0].target, None)
        rows.append([name, *cells(contender, tasks, columns)])
        print(rows[-1], flush=True)
    print(machine(), "\n")
    print_table(("parts", *columns, "city, median", "CPU ms"), rows)


def cells(contender: Contender, tasks: list[Task], columns: list[str]) -> list[str]:
    found: list[tuple[Task, Trial]] = [
        (task, tried(contender, task.source, task.target, task.truth, task.tolerance))
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
