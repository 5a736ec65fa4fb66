"""Registration of consecutive scans: errors of the pairs, and chained trajectories.

Evaluation of Das et al. 2013, section VIII, in the city and in the forest.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Vector
from scanlock.errors import require_positive
from scanlock.evaluation.box_plot import box_plot
from scanlock.experiments.experiment import Outcome
from scanlock.geometry.pose import Pose
from scanlock.pipelines.study import StudyRecord
from scanlock.report.tables import Cell, Column, Table


@dataclass(frozen=True, kw_only=True, slots=True)
class Tolerance:
    """Maximum errors of a solved pair."""

    metres: float = 0.3
    """Maximum translation error at the centre of the source [m]."""

    degrees: float = 1.0
    """Maximum rotation error [deg]."""

    def __post_init__(self) -> None:
        require_positive("metres", self.metres, unit="m")
        require_positive("degrees", self.degrees, unit="deg")

    def accepts(self, record: StudyRecord) -> bool:
        """Return whether a registration is solved."""
        return record.is_solved(self.metres, math.radians(self.degrees))

    def __str__(self) -> str:
        return f"{self.metres:g} m and {self.degrees:g} degree"


SOLVED = Tolerance()
"""Tolerance of the experiments; the papers state none."""

TRUTH = "true poses"
"""Name of the trajectory and the map of the true poses."""


def chained(records: Sequence[StudyRecord]) -> list[Pose]:
    """Return the poses first_from_scan of all scans from the poses of consecutive pairs.

    A pair without a pose counts as no motion.
    """
    trajectory = [Pose.identity()]
    for record in records:
        trajectory.append(trajectory[-1] if record.pose is None else trajectory[-1] @ record.pose)
    return trajectory


def trajectories_of(outcome: Outcome) -> dict[str, list[Pose]]:
    """Return the chained trajectory of each contender, and the true one if known."""
    trajectories = {name: chained(records) for name, records in outcome.records.items()}
    if outcome.series.truth:
        trajectories[TRUTH] = outcome.series.true_trajectory()
    return trajectories


def translation_errors(records: Sequence[StudyRecord]) -> Vector:
    """Return the (n,) translation errors [m]; NaN for pairs without a pose or a true pose."""
    return np.array([record.translation_error for record in records])


def rotation_errors_deg(records: Sequence[StudyRecord]) -> Vector:
    """Return the (n,) rotation errors [deg]; NaN for pairs without a pose or a true pose."""
    return np.degrees([record.rotation_error for record in records])


ERROR_PANELS = (
    ("absolute translation error [m]", translation_errors),
    ("absolute rotation error [°]", rotation_errors_deg),
)
"""Panels of Figure 3 of the paper: titles, and functions from records to errors."""


def error_table(outcome: Outcome, tolerance: Tolerance = SOLVED) -> Table:
    """Return solved pairs and quartiles of the errors, one row per contender."""
    columns = [
        Column("method"),
        Column("pairs", "d"),
        Column("solved", "d"),
        Column("lower quartile [m]", ".3f"),
        Column("median [m]", ".3f"),
        Column("upper quartile [m]", ".3f"),
        Column("worst [m]", ".3f"),
        Column("lower quartile [deg]", ".3f"),
        Column("median [deg]", ".3f"),
        Column("upper quartile [deg]", ".3f"),
        Column("worst [deg]", ".3f"),
        Column("called ok", "d"),
        Column("called ok but not solved", "d"),
    ]
    rows: list[list[Cell]] = []
    for name, records in outcome.records.items():
        evaluated = [record for record in records if not math.isnan(record.translation_error)]
        solved: Cell = (
            sum(tolerance.accepts(record) for record in evaluated) if evaluated else math.nan
        )
        wrong: Cell = sum(record.ok and not tolerance.accepts(record) for record in evaluated)
        errors = (translation_errors(records), rotation_errors_deg(records))
        numbers = [number for values in errors for number in _quartiles(values)]
        ok = sum(record.ok for record in records)
        rows.append([name, len(records), solved, *numbers, ok, wrong if evaluated else math.nan])
    return Table(columns, rows)


def pair_table(outcome: Outcome) -> Table:
    """Return all registrations, one per row."""
    pairs = {pair.name: pair for pair in outcome.pairs}
    columns = [
        Column("method"),
        Column("target"),
        Column("source"),
        Column("status"),
        Column("translation error [m]", ".4f"),
        Column("rotation error [deg]", ".4f"),
        Column("overlap", ".3f"),
        Column("score", ".3f"),
        Column("evaluations", "d"),
    ]
    rows: list[list[Cell]] = [
        [
            name,
            pairs[record.task.pair].target,
            pairs[record.task.pair].source,
            record.status,
            record.translation_error,
            math.degrees(record.rotation_error),
            record.overlap,
            record.score,
            record.evaluations,
        ]
        for name, records in outcome.records.items()
        for record in records
    ]
    return Table(columns, rows)


def _quartiles(values: Vector) -> list[float]:
    if not np.isfinite(values).any():
        return [math.nan] * 4
    box = box_plot(values)
    return [box.lower_quartile, box.median, box.upper_quartile, float(np.nanmax(values))]
