"""What each part of the default method is worth: the same pairs with single parts turned off.

    python benchmarks/parts.py --data FOLDER [--headings 2] [--pairs 12] [--only TEXT]

Real pairs with random headings, as any_start.py makes them (every second pair of a drive), and
simulated ones, as far_pairs.py makes them; no initial pose. A cell holds how many are solved; then
the median errors over the pairs ten scans apart of the city drive, whose reference is the best, and
the median CPU time of one whole call over all real pairs.
"""

import argparse
import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from any_start import all_pairs, headings, tolerance_of
from far_pairs import far_pair
from peers import Searcher, ours
from scanlock.geometry.pose import Pose
from scanlock.registration.auto import Auto
from scanlock.registration.coarse_to_fine import DEFAULT_SCALES
from scanlock.registration.descents import Descents
from scanlock.registration.fine_stage import FineStage
from scanlock.registration.heading_search import HeadingSearch
from tables import machine, print_table
from trials import Trial, tried

_FULL = Auto()

VARIANTS: dict[str, Auto] = {
    "all parts": _FULL,
    "no search: the identity's basin": replace(_FULL, search=None),
    "search without open ground": replace(_FULL, search=HeadingSearch(openness=0.0)),
    "search without whitening": replace(_FULL, search=HeadingSearch(whitening=0.0)),
    "only the first hypothesis": replace(_FULL, search=HeadingSearch(most=1)),
    "hypotheses not laid on the ground": replace(_FULL, search=HeadingSearch(fits_ground=False)),
    "no free space": replace(_FULL, imager=None),
    "descents from 2 m, near parts leading": replace(
        _FULL,
        descents=Descents(scales=tuple(replace(one, is_entry=False) for one in DEFAULT_SCALES[2:])),
    ),
    "no fine stage": replace(_FULL, fine=None),
    "fine stage on one grid": replace(_FULL, fine=FineStage(offsets=(0.0,))),
    "fine stage, cells of 0.5 m": replace(_FULL, fine=FineStage(widths=(0.5, 1.0, 2.0, 4.0))),
    "fine stage, cells of 2 m": replace(_FULL, fine=FineStage(widths=(2.0, 4.0))),
}

FAMILIES = {
    "city": "kitti",
    "handheld": "handheld",
    "others": "",
}
"""Columns of real pairs: how the names of their groups begin; the last takes what is left."""


@dataclass(frozen=True)
class Task:
    """Two scans and the pose between them."""

    column: str
    group: str
    target: Any
    source: Any
    truth: Pose
    tolerance: tuple[float, float]


def real_tasks(data: Path, count: int, only: str) -> Iterator[Task]:
    for index, pair in enumerate(all_pairs(data)):
        if only not in pair.group or (pair.group.startswith("kitti") and index % 2):
            continue
        column = next(name for name, begin in FAMILIES.items() if pair.group.startswith(begin))
        source = pair.load_source()
        for turn in headings(pair.group, index, count):
            yield Task(
                column, pair.group, pair.load_target(), turn.apply(source),
                pair.truth @ turn.inverse(), tolerance_of(pair.group),
            )  # fmt: skip


def far_tasks(count: int) -> Iterator[Task]:
    for kind in ("street", "forest"):
        for seed in range(count):
            for baseline, pair in far_pair(kind, seed):
                group = f"{kind}, {baseline[0]:g}-{baseline[1]:g} m"
                yield Task(
                    group, group, pair.target.points, pair.source.points,
                    pair.target_from_source, (0.3, 1.0),
                )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=os.environ.get("SCANLOCK_DATA"))
    parser.add_argument("--headings", type=int, default=2, help="headings of each real pair")
    parser.add_argument("--pairs", type=int, default=12, help="scenes of each simulated kind")
    parser.add_argument("--only", default="", help="variants whose name contains this text")
    arguments = parser.parse_args()
    if arguments.data is None:
        parser.error("give --data FOLDER or set SCANLOCK_DATA")
    tasks = [*real_tasks(arguments.data, arguments.headings, ""), *far_tasks(arguments.pairs)]
    columns = list(dict.fromkeys(task.column for task in tasks))
    rows: list[list[str]] = []
    for name, method in VARIANTS.items():
        if arguments.only not in name:
            continue
        searcher = ours(name, method)
        searcher.register(tasks[0].source, tasks[0].target)
        rows.append([name, *cells(searcher, tasks, columns)])
        print(rows[-1], flush=True)
    print(machine(), "\n")
    print_table(("parts", *columns, "city, 10 apart", "CPU ms"), rows)


def cells(searcher: Searcher, tasks: list[Task], columns: list[str]) -> list[str]:
    found: list[tuple[Task, Trial]] = [
        (task, tried(searcher, task.source, task.target, task.truth, task.tolerance))
        for task in tasks
    ]
    texts: list[str] = []
    for column in columns:
        solved = [one.solved for task, one in found if task.column == column]
        texts.append(f"{sum(solved)} / {len(solved)}")
    city = [one for task, one in found if task.group == "kitti_drive_0005, 10 apart"]
    metres, degrees = (
        np.median([getattr(one, unit) for one in city]) for unit in ("metres", "degrees")
    )
    real = [one.seconds for task, one in found if task.column in FAMILIES]
    return [*texts, f"{100 * metres:.2f} cm, {degrees:.3f}°", f"{1e3 * np.median(real):.0f}"]


if __name__ == "__main__":
    main()
