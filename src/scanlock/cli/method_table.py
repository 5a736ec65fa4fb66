"""Printed table of methods, with their times."""

import math
from collections.abc import Iterable, Mapping, Sequence
from statistics import median
from typing import TYPE_CHECKING

from scanlock.cli.console import print_line, print_table, print_title

if TYPE_CHECKING:
    from scanlock.experiments.comparison import ComparisonResult
    from scanlock.experiments.pairwise import Tolerance
    from scanlock.pipelines.starts import AroundTruth
    from scanlock.pipelines.study import StudyRecord


def show_errors(
    records: "Mapping[str, Sequence[StudyRecord]]",
    tolerance: "Tolerance",
    *,
    voxels: Mapping[str, int] | None = None,
) -> None:
    """Print one row per method: solved pairs, errors, filled voxels and times.

    Parameters
    ----------
    records : mapping of str to sequence of StudyRecord
        By method.
    tolerance : Tolerance
        Errors below which a pair is solved.
    voxels : mapping of str to int, optional
        Filled voxels of the map, by method.
    """
    heads = ["method", "ok", "solved", "median [m]", "median [deg]", "ms per pair"]
    rows = [[name, *_row(found, tolerance)] for name, found in records.items()]
    if voxels is not None:
        heads.insert(-1, "voxels")
        for row in rows:
            row.insert(-1, f"{voxels[row[0]]:,}" if row[0] in voxels else "-")
    print_table(heads, rows)
    print_line("ms per pair: to prepare and register both scans, without reading and compiling")


def show_basins(done: "ComparisonResult", plan: "AroundTruth", tolerance: "Tolerance") -> None:
    """Print one row per method: solved initial poses of all, by distance and by angle."""
    from scanlock.experiments.comparison import basins

    heads = [
        "method",
        "all",
        *(f"{distance:g} m" for distance in plan.distances),
        *(f"{math.degrees(angle):g} deg" for angle in plan.angles),
    ]
    rows: list[list[str]] = []
    for name, basin in basins(done, plan, tolerance).items():
        counts = [basin.solved.sum(), *basin.solved.sum(axis=1), *basin.solved.sum(axis=0)]
        tried = [basin.tried.sum(), *basin.tried.sum(axis=1), *basin.tried.sum(axis=0)]
        rows.append([name, *(f"{n} / {of}" for n, of in zip(counts, tried, strict=True))])
    print_title("solved initial poses around the true pose, by their error")
    print_table(heads, rows)


def _row(records: "Sequence[StudyRecord]", tolerance: "Tolerance") -> list[str]:
    judged = [record for record in records if not math.isnan(record.translation_error)]
    solved = sum(tolerance.accepts(record) for record in judged)
    return [
        f"{sum(record.ok for record in records)} / {len(records)}",
        f"{solved} / {len(judged)}" if judged else "-",
        _median((record.translation_error for record in judged), ".3f"),
        _median((math.degrees(record.rotation_error) for record in judged), ".3f"),
        _median((1e3 * record.seconds for record in records), ".0f"),
    ]


def _median(values: Iterable[float], form: str) -> str:
    finite = [value for value in values if not math.isnan(value)]
    return format(median(finite), form) if finite else "-"
