"""Figure of a trajectory and the true one: both from above, and the errors along the path."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from scanlock.evaluation.alignment import Alignment, aligned
from scanlock.evaluation.trajectory_errors import absolute_errors, path_lengths
from scanlock.geometry.pose import Pose
from scanlock.report.canvas import BLUE, FAINT, INK, VERMILION, blank_figure, legend_below

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def trajectory_figure(
    estimate: Sequence[Pose],
    truth: Sequence[Pose],
    *,
    alignment: Alignment = "first",
    title: str = "",
) -> "Figure":
    """Return a figure of two trajectories in the frame of the true one, with absolute errors.

    Parameters
    ----------
    estimate, truth : sequence of Pose
        Poses ``world_from_sensor`` of the same scans.
    alignment : str
        Alignment of the trajectories; see `absolute_errors`.
    title : str
        Title of the figure.

    Raises
    ------
    MissingExtra
        Matplotlib is not installed.
    InvalidInput
        The trajectories are empty or differ in length.
    """
    errors = absolute_errors(estimate, truth, alignment)
    figure = blank_figure(10.5, 5.2)
    if title:
        figure.suptitle(title, fontsize=12, color=INK)
    grid = figure.add_gridspec(2, 2, width_ratios=(1.15, 1.0))
    above = figure.add_subplot(grid[:, 0])
    true_positions = np.array([pose.translation for pose in truth])
    positions = np.array([pose.translation for pose in aligned(estimate, truth, alignment)])
    for line, colour in ((true_positions, BLUE), (positions, VERMILION)):
        above.plot(line[:, 0], line[:, 1], color=colour, linewidth=1.4)
    above.plot(*true_positions[0, :2], color=INK, marker="o", ms=5)
    above.set_aspect("equal", adjustable="datalim")
    _format(above, "x [m]", "y [m]")
    along = path_lengths(truth)
    translation, rotation = (figure.add_subplot(grid[row, 1]) for row in range(2))
    translation.plot(along, errors.translations, color=VERMILION, linewidth=1.2)
    _format(translation, "", "translation error [m]")
    rotation.plot(along, errors.rotations * (180.0 / math.pi), color=VERMILION, linewidth=1.2)
    _format(rotation, "true path length [m]", "rotation error [deg]")
    for axes in (translation, rotation):
        axes.set_ylim(bottom=0.0)
    legend_below(figure, {"true": BLUE, "estimated": VERMILION})
    return figure


def _format(axes: "Axes", horizontal: str, vertical: str) -> None:
    axes.set_xlabel(horizontal, fontsize=8, color=FAINT)
    axes.set_ylabel(vertical, fontsize=8, color=FAINT)
    axes.tick_params(labelsize=8, colors=FAINT, length=2)
    axes.grid(color="#eeeeee", linewidth=0.6)
    axes.set_axisbelow(True)
    for spine in axes.spines.values():
        spine.set_color("#cccccc")
