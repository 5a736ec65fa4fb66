"""Tables of the ladar experiment, with medians over all places."""

import math
from collections.abc import Sequence

import numpy as np

from scanlock.evaluation.closest_distances import closest_distances, inlier_mean
from scanlock.experiments.ladar.outcome import LadarOutcome
from scanlock.experiments.ladar.rows import ROWS, STARTS
from scanlock.experiments.ladar.series import DRIVES
from scanlock.geometry.pose import Pose
from scanlock.report.tables import Cell, Column, Table


def paper_table(found: LadarOutcome) -> Table:
    """Return Table 1 with the numbers of the paper and of each contender."""
    columns = [
        Column("data set"),
        Column("method"),
        Column("mean distance in the paper [cm]", ".2f"),
        Column("mean distance [cm]", ".2f"),
        Column("at the exact pose [cm]", ".2f"),
        Column("iterations in the paper", "d"),
        Column("iterations", ".0f"),
        Column("solved"),
        Column("translation error [m]", ".3f"),
        Column("rotation error [deg]", ".3f"),
    ]
    rows: list[list[Cell]] = []
    for row in ROWS:
        for name in found.outcome.records:
            records = found.records(row.drive, row.start, name)
            rows.append(
                [
                    row.name,
                    name,
                    100.0 * row.distance,
                    100.0 * finite_median(found.distances(row.drive, row.start, name)),
                    100.0 * finite_median(found.exact_distances(row.drive)),
                    row.iterations,
                    finite_median([float(record.evaluations) for record in records]),
                    f"{found.solved(row.drive, row.start, name)} / {len(records)}",
                    finite_median([record.translation_error for record in records]),
                    math.degrees(finite_median([record.rotation_error for record in records])),
                ]
            )
    return Table(columns, rows)


def solved_table(found: LadarOutcome) -> Table:
    """Return the number of solved places by drive, start and contender."""
    names = [*found.outcome.records]
    printed = {(row.drive, row.start): row.name for row in ROWS}
    rows: list[list[Cell]] = [
        [
            str(drive),
            start,
            printed.get((drive, start), "-"),
            *(f"{found.solved(drive, start, name)} / {found.places}" for name in names),
        ]
        for drive in DRIVES
        for start in STARTS.names
    ]
    return Table(
        [Column("frames"), Column("D moved by"), Column("in the paper"), *map(Column, names)], rows
    )


def drive_table(found: LadarOutcome) -> Table:
    """Return the motion of each drive between its frames, and the mean distances."""
    columns = [
        Column("frames"),
        Column("speed [m/s]", ".2f"),
        Column("distance between [m]", ".3f"),
        Column("rotation between [deg]", ".3f"),
        Column("points of M", ".0f"),
        Column("points of D", ".0f"),
        Column("mean distance as taken [cm]", ".2f"),
        Column("at the exact pose [cm]", ".2f"),
        Column("minimum [cm]", ".2f"),
        Column("maximum [cm]", ".2f"),
    ]
    load = found.outcome.series.load
    rows: list[list[Cell]] = []
    for drive in DRIVES:
        pairs = found.pairs(drive)
        motions = [pair.truth.distance(Pose.identity()) for pair in pairs if pair.truth]
        scans = [(np.asarray(load(one.target)), np.asarray(load(one.source))) for one in pairs]
        before = [inlier_mean(closest_distances(*both, Pose.identity())) for both in scans]
        exact = [100.0 * metres for metres in found.exact_distances(drive)]
        rows.append(
            [
                str(drive),
                drive.speed,
                finite_median([metres for metres, _ in motions]),
                math.degrees(finite_median([radians for _, radians in motions])),
                finite_median([float(len(model)) for model, _ in scans]),
                finite_median([float(len(data)) for _, data in scans]),
                100.0 * finite_median(before),
                finite_median(exact),
                min(exact),
                max(exact),
            ]
        )
    return Table(columns, rows)


def finite_median(values: Sequence[float]) -> float:
    """Return the median of the finite values; NaN without any."""
    finite = np.array(values)[np.isfinite(values)]
    return float(np.median(finite)) if len(finite) else math.nan
