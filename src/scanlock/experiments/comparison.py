"""Methods on scans of one's own: their errors, and how far from the truth they may start."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from scanlock.experiments.experiment import Findings, Outcome, Section, Watch, unwatched
from scanlock.experiments.pairwise import (
    ERROR_PANELS,
    SOLVED,
    Limits,
    error_table,
    pair_table,
)
from scanlock.experiments.series import ScanSeries
from scanlock.geometry.pose import Pose
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
    """What is compared, and how."""

    methods: Mapping[str, Method[Any]]
    """By the names they go by."""

    pairs: Sequence[StudyPair]
    """What each registers, from the identity."""

    load: Callable[[str], ArrayLike]
    """Returns the points of a scan by its name."""

    key: str
    """What decides these points besides the names."""

    around: AroundTruth | None = None
    """Further starts about the true pose of each pair that has one; none by default."""

    take_agreed: bool = False
    """Whether a pose that methods agree upon counts as true where no other is known."""

    limits: Limits = field(default_factory=lambda: SOLVED)
    """What counts as solved, and as agreeing."""


@dataclass(frozen=True, slots=True, eq=False)
class Compared:
    """What came of a comparison.

    Attributes
    ----------
    pairs : sequence of StudyPair
        With the poses that were taken for true.
    direct, around : mapping of str to sequence of StudyRecord
        Registrations from the identity, and from about the true poses, by method.
    agreed : int
        How many of the true poses are what methods agree upon.
    """

    pairs: Sequence[StudyPair]
    direct: Records
    around: Records
    agreed: int

    @property
    def judged(self) -> int:
        """How many pairs have a pose that was taken for true."""
        return sum(pair.truth is not None for pair in self.pairs)


def compare(comparison: Comparison, path: Path, watch: Watch = unwatched) -> Compared:
    """Register every pair by every method and keep the records in a file.

    Parameters
    ----------
    comparison : Comparison
    path : Path
        Where records are kept; those of an earlier run are not made again.
    watch : Watch, optional
        Is told of every registration.
    """
    study = Study(methods=comparison.methods, pairs=comparison.pairs, load=comparison.load)
    direct = _grouped(
        comparison,
        list(watch(stored_records(path, study, comparison.key), len(study), "registering")),
    )
    pairs, agreed = [*comparison.pairs], 0
    if comparison.take_agreed:
        pairs = [_with_agreed(comparison, pair, direct) for pair in pairs]
        agreed = sum(
            new.truth is not old.truth for new, old in zip(pairs, comparison.pairs, strict=True)
        )
        truths = {pair.name: pair.truth for pair in pairs}
        direct = {
            name: [record.with_truth(truths[record.task.pair]) for record in records]
            for name, records in direct.items()
        }
    around: Records = {}
    known = [pair for pair in pairs if pair.truth is not None]
    if comparison.around is not None and known:
        study = replace(study, pairs=known, starts=comparison.around)
        records = stored_records(path, study, comparison.key)
        around = _grouped(comparison, list(watch(records, len(study), "starting far away")))
    return Compared(pairs, direct, around, agreed)


def agreed_pose(records: Sequence[StudyRecord], limits: Limits = SOLVED) -> Pose | None:
    """Return the pose of one pair that most methods agree upon; None where no two do.

    Only registrations that are called ok have a say. Of poses that as many agree with, the one
    with the greatest product of overlap and score is taken.
    """
    called = [record for record in records if record.ok]
    best: tuple[int, float] = (0, -math.inf)
    pose: Pose | None = None
    for record in called:
        support = sum(_agree(record, other, limits) for other in called if other is not record)
        rank = (support, record.overlap * record.score)
        if support > 0 and rank > best:
            best, pose = rank, record.pose
    return pose


def basins(compared: Compared, plan: AroundTruth, limits: Limits = SOLVED) -> dict[str, Basin]:
    """Return how often each method solved a pair from each distance and angle."""
    rows = {distance: row for row, distance in enumerate(plan.distances)}
    columns = {angle: column for column, angle in enumerate(plan.angles)}
    found: dict[str, Basin] = {}
    for name, records in compared.around.items():
        solved, tried = np.zeros((2, len(rows), len(columns)), np.int64)
        for record in records:
            distance, angle = plan.levels[record.task.start]
            cell = rows[distance], columns[angle]
            tried[cell] += 1
            solved[cell] += limits.hold(record)
        found[name] = Basin(solved, tried)
    return found


def basin_table(compared: Compared, plan: AroundTruth, limits: Limits = SOLVED) -> Table:
    """Return a row for each method, distance and angle."""
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
    for name, records in compared.around.items():
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
                        sum(limits.hold(record) for record in here),
                        sum(record.ok for record in here),
                        sum(record.ok and not limits.hold(record) for record in here),
                    ]
                )
    return Table(columns, rows)


def _grouped(comparison: Comparison, records: Sequence[StudyRecord]) -> dict[str, Any]:
    return {
        name: [record for record in records if record.task.method == name]
        for name in comparison.methods
    }


def _with_agreed(comparison: Comparison, pair: StudyPair, direct: Records) -> StudyPair:
    if pair.truth is not None:
        return pair
    here = [
        record for records in direct.values() for record in records if record.task.pair == pair.name
    ]
    return replace(pair, truth=agreed_pose(here, comparison.limits))


def _agree(one: StudyRecord, other: StudyRecord, limits: Limits) -> bool:
    return limits.hold(one.with_truth(other.pose))


def comparison_findings(comparison: Comparison, compared: Compared, series: ScanSeries) -> Findings:
    """Return the tables and figures of a comparison, ready to be written."""
    limits = comparison.limits
    outcome = Outcome(series=series, pairs=compared.pairs, records=compared.direct)
    tables = {"errors": error_table(outcome, limits), "pairs": pair_table(outcome)}
    if not compared.judged:
        text = "Nothing was taken for true, so there are no errors to show."
        return Findings(sections=[Section(title="From no motion", text=text, tables=tables)])
    text = (
        f"{compared.judged} of {len(compared.pairs)} pairs have a pose to be judged by, "
        f"{compared.agreed} of them because methods agree upon it. A pair is solved within "
        f"{limits} of that pose."
    )
    panels = [
        BoxPanel(title, {name: errors(records) for name, records in compared.direct.items()})
        for title, errors in ERROR_PANELS
    ]
    figures = {"errors": box_figure(panels)}
    sections = [Section(title="From no motion", text=text, tables=tables, figures=figures)]
    plan = comparison.around
    if plan is not None:
        text = (
            "Every pair with such a pose was started with each distance and angle of the table, "
            f"{plan.repeats} of each, in random directions "
            f"({'about the vertical' if plan.axis == 'vertical' else 'about any axis'}, seed "
            f"{plan.seed})."
        )
        figure = basin_figure(
            basins(compared, plan, limits),
            plan.distances,
            [round(math.degrees(angle), 9) for angle in plan.angles],
        )
        sections.append(
            Section(
                title="Basin of convergence",
                text=text,
                tables={"basin": basin_table(compared, plan, limits)},
                figures={"basin": figure},
            )
        )
    return Findings(sections=sections)
