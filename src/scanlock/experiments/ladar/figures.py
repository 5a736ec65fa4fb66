"""Figures 2 and 3 of Madhavan and Messina 2003, at the first place."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from scanlock.arrays import Points
from scanlock.evaluation.closest_distances import closest_distances
from scanlock.experiments.ladar.outcome import LadarOutcome
from scanlock.experiments.ladar.rows import ROWS, STARTS, PaperRow
from scanlock.experiments.ladar.series import range_image
from scanlock.geometry.pose import Pose
from scanlock.report.alignment_figure import Alignment, alignment_figure
from scanlock.report.distance_figure import DistancePanel, distance_figure
from scanlock.report.range_figure import range_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def ladar_figures(found: LadarOutcome, shown: Sequence[str]) -> dict[str, "Figure"]:
    """Return the figures by file name.

    Parameters
    ----------
    found : LadarOutcome
    shown : sequence of str
        Contenders in the figures.
    """
    drawn = [row for row in ROWS if row.name != "#2"]
    scans = {row.name: first_scans(found, row) for row in drawn}
    placed = {row.name: _placed(found, row, shown) for row in drawn}
    model, data = scans["#1"]
    return {
        "range-images": range_figure({"M of #1": range_image(model), "D of #1": range_image(data)}),
        "registration": alignment_figure(
            [
                Alignment(
                    row.name,
                    scans[row.name][0],
                    {
                        name: pose.apply(scans[row.name][1])
                        for name, pose in placed[row.name].items()
                    },
                )
                for row in drawn
            ]
        ),
        "distances": distance_figure(
            [
                DistancePanel(
                    str(row),
                    {
                        name: closest_distances(*scans[row.name], pose)
                        for name, pose in placed[row.name].items()
                    },
                )
                for row in drawn
            ]
        ),
    }


def first_scans(found: LadarOutcome, row: PaperRow) -> tuple[Points, Points]:
    """Return the points of model M and data D [m] of a row at the first place."""
    pair = found.pairs(row.drive)[0]
    load = found.outcome.series.load
    return np.asarray(load(pair.target)), np.asarray(load(pair.source))


def first_poses(found: LadarOutcome, row: PaperRow) -> dict[str, Pose]:
    """Return the poses of a row at the first place, without failed contenders."""
    poses = {
        name: found.records(row.drive, row.start, name)[0].pose for name in found.outcome.records
    }
    return {name: pose for name, pose in poses.items() if pose is not None}


def _placed(found: LadarOutcome, row: PaperRow, shown: Sequence[str]) -> Mapping[str, Pose]:
    """Return the poses of D before and after registration; the start for failed contenders."""
    start = STARTS.pose(row.start, "", None, np.zeros(3))
    ends = first_poses(found, row)
    after = {
        f"after {name}" if name in ends else f"{name} failed": ends.get(name, start)
        for name in shown
    }
    return {"before": start} | after
