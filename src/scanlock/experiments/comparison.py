"""Comparison of methods on recorded scans: errors, and basins of convergence."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from scanlock.experiments.consensus import consensus, reference_pose
from scanlock.experiments.experiment import Findings, Outcome, Progress, Section, no_progress
from scanlock.experiments.pairwise import (
    ERROR_PANELS,
    SOLVED,
    Tolerance,
    error_table,
    pair_table,
)
from scanlock.experiments.series import ScanSeries
from scanlock.pipelines.starts import AroundTruth
from scanlock.pipelines.study import Study, StudyPair, StudyRecord
from scanlock.pipelines.study_records import stored_records
from scanlock.registration.methods.protocol import Method
from scanlock.report.basin_figure import Basin, basin_figure
from scanlock.report.box_figure import BoxPanel, box_figure
from scanlock.report.tables import Cell, Column, Table

Records = Mapping[str, Sequence[StudyRecord]]
"""Records by method, in the order of pairs and starts."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Comparison:
    """Methods and pairs of a comparison, with its options."""

    methods: Mapping[str, Method[Any]]
    """Compared methods by name."""

    pairs: Sequence[StudyPair]
    """Pairs, registered from the identity."""

    load: Callable[[str], ArrayLike]
    """Function from the name of a scan to its (n, 3+) points [m]."""

    key: str
    """Identifier of the points, in addition to the names."""

    around: AroundTruth | None = None
    """Additional starts around the true pose of each pair; none by default."""

    use_consensus: bool = False
    """Whether a consensus of the methods replaces an unknown true pose."""

    tolerance: Tolerance = field(default_factory=lambda: SOLVED)
    """Maximum errors of a solved pair, and maximum differences within a consensus."""

    threads: int = 1
    """Maximum number of threads of a registration; only times depend on it."""


@dataclass(frozen=True, slots=True, eq=False)
class ComparisonResult:
    """Records of a comparison.

    Attributes
    ----------
    pairs : sequence of StudyPair
        Pairs with the true poses of the evaluation.
    direct, around : mapping of str to sequence of StudyRecord
        Registrations from the identity, and from starts around the true poses, by method.
    consensus_count : int
        Number of true poses that are a consensus of the methods.
    """

    pairs: Sequence[StudyPair]
    direct: Records
    around: Records
    consensus_count: int

    @property
    def evaluated_count(self) -> int:
        """Number of pairs with a true pose."""
        return sum(pair.truth is not None for pair in self.pairs)


def compare(
    comparison: Comparison, path: Path, progress: Progress = no_progress
) -> ComparisonResult:
    """Register every pair by every method and store the records in a file.

    Parameters
    ----------
    comparison : Comparison
    path : Path
        File of the records; registrations of an earlier run are not repeated.
    progress : Progress, optional
        Report of the registrations.
    """
    study = Study(
        methods=comparison.methods,
        pairs=comparison.pairs,
        load=comparison.load,
        threads=comparison.threads,
    )
    records = progress(stored_records(path, study, comparison.key), len(study), "registering")
    direct = _grouped(comparison, list(records))
    agreeing = _consensus_of_pairs(comparison, direct) if comparison.use_consensus else {}
    pairs = [
        replace(pair, truth=agreeing[pair.name][0].pose) if agreeing.get(pair.name) else pair
        for pair in comparison.pairs
    ]
    around: Records = {}
    known = [pair for pair in pairs if pair.truth is not None]
    if comparison.around is not None and known:
        study = replace(study, pairs=known, starts=comparison.around)
        records = stored_records(path, study, comparison.key)
        around = _grouped(
            comparison, list(progress(records, len(study), "starts around the truth"))
        )
    return ComparisonResult(
        pairs,
        _referenced(direct, agreeing),
        _referenced(around, agreeing),
        sum(map(bool, agreeing.values())),
    )


def _consensus_of_pairs(
    comparison: Comparison, direct: Records
) -> dict[str, tuple[StudyRecord, ...]]:
    """Return the consensus on each pair without a true pose, by the name of the pair."""
    found: dict[str, tuple[StudyRecord, ...]] = {}
    for row, pair in enumerate(comparison.pairs):
        if pair.truth is None:
            here = [records[row] for records in direct.values()]
            found[pair.name] = consensus(here, comparison.tolerance)
    return found


def _referenced(
    records: Records, agreeing: Mapping[str, tuple[StudyRecord, ...]]
) -> dict[str, list[StudyRecord]]:
    """Return records with errors from the consensus, of which their own method has no part."""
    return {
        method: [
            record.with_truth(reference_pose(agreeing[record.task.pair], method))
            if record.task.pair in agreeing
            else record
            for record in found
        ]
        for method, found in records.items()
    }


def basins(
    result: ComparisonResult, plan: AroundTruth, tolerance: Tolerance = SOLVED
) -> dict[str, Basin]:
    """Return the solved starts by distance and angle, for each method."""
    rows = {distance: row for row, distance in enumerate(plan.distances)}
    columns = {angle: column for column, angle in enumerate(plan.angles)}
    found: dict[str, Basin] = {}
    for name, records in result.around.items():
        solved, tried = np.zeros((2, len(rows), len(columns)), np.int64)
        for record in records:
            distance, angle = plan.levels[record.task.start]
            cell = rows[distance], columns[angle]
            tried[cell] += 1
            solved[cell] += tolerance.accepts(record)
        found[name] = Basin(solved, tried)
    return found


def basin_table(
    result: ComparisonResult, plan: AroundTruth, tolerance: Tolerance = SOLVED
) -> Table:
    """Return the table of the basins, one row per method, distance and angle."""
    columns = [
        Column("method"),
        Column("initial translation error [m]", "g"),
        Column("initial rotation error [deg]", "g"),
        Column("starts", "d"),
        Column("solved", "d"),
        Column("called ok", "d"),
        Column("called ok but not solved", "d"),
    ]
    rows: list[list[Cell]] = []
    for name, records in result.around.items():
        for distance in plan.distances:
            for angle in plan.angles:
                here = [
                    record
                    for record in records
                    if plan.levels[record.task.start] == (distance, angle)
                ]
                rows.append(
                    [
                        name,
                        distance,
                        round(math.degrees(angle), 9),
                        len(here),
                        sum(tolerance.accepts(record) for record in here),
                        sum(record.ok for record in here),
                        sum(record.ok and not tolerance.accepts(record) for record in here),
                    ]
                )
    return Table(columns, rows)


def _grouped(comparison: Comparison, records: Sequence[StudyRecord]) -> dict[str, Any]:
    return {
        name: [record for record in records if record.task.method == name]
        for name in comparison.methods
    }


def comparison_findings(
    comparison: Comparison, result: ComparisonResult, series: ScanSeries
) -> Findings:
    """Return the tables and figures of a comparison."""
    tolerance = comparison.tolerance
    outcome = Outcome(series=series, pairs=result.pairs, records=result.direct)
    tables = {"errors": error_table(outcome, tolerance), "pairs": pair_table(outcome)}
    if not result.evaluated_count:
        text = "The true poses are not known, so there are no errors to show."
        return Findings(sections=[Section(title="From the identity", text=text, tables=tables)])
    text = (
        f"{result.evaluated_count} of {len(result.pairs)} pairs have a true pose; "
        f"{result.consensus_count} of these are a consensus of the methods, in which each method "
        f"is compared with the best other one. A pair is solved within {tolerance} of the true "
        "pose."
    )
    panels = [
        BoxPanel(title, {name: errors(records) for name, records in result.direct.items()})
        for title, errors in ERROR_PANELS
    ]
    figures = {"errors": box_figure(panels)}
    sections = [Section(title="From the identity", text=text, tables=tables, figures=figures)]
    plan = comparison.around
    if plan is not None:
        text = (
            "Every pair with a true pose was registered from each distance and angle of the table, "
            f"{'once' if plan.repeats == 1 else f'{plan.repeats} times'}, in random directions "
            f"({'about the vertical' if plan.axis == 'vertical' else 'about any axis'}, seed "
            f"{plan.seed})."
        )
        figure = basin_figure(
            basins(result, plan, tolerance),
            plan.distances,
            [round(math.degrees(angle), 9) for angle in plan.angles],
        )
        sections.append(
            Section(
                title="Basin of convergence",
                text=text,
                tables={"basin": basin_table(result, plan, tolerance)},
                figures={"basin": figure},
            )
        )
    return Findings(sections=sections)
