"""Figure of a trajectory and the true one: both from above, and the errors along the path."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from scanlock.arrays import Points, Vector
from scanlock.evaluation.alignment import Alignment, aligned, positions
from scanlock.evaluation.trajectory_errors import TrajectoryErrors, absolute_errors, path_lengths
from scanlock.geometry.pose import Pose
from scanlock.report.canvas import BLUE, FAINT, INK, VERMILION, blank_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLOURS = "plasma"
_COLOUR_RANGE = (0.0, 0.85)
"""Part of the colours that is visible on white."""

_TRUE_COLOUR = "#c8c8c8"
_TRUE_WIDTH = 4.0
"""Line width of the true trajectory, below the narrower estimate."""

_MIN_FORWARD_RATIO = 0.5
"""Extent along z relative to that along x or y from which z is a horizontal axis.

The z axis of a camera points forward and belongs in the view; that of a laser points up.
"""


def trajectory_figure(
    estimate: Sequence[Pose],
    truth: Sequence[Pose],
    *,
    alignment: Alignment = "first",
    relative: TrajectoryErrors | None = None,
    apart: str = "",
    times: Vector | None = None,
    title: str = "",
) -> "Figure":
    """Return a figure of two trajectories in the frame of the true one, with their errors.

    The estimate is coloured by its absolute error.

    Parameters
    ----------
    estimate, truth : sequence of n Pose
        Poses ``world_from_sensor`` of the same scans.
    alignment : str
        Alignment of the trajectories; see `absolute_errors`.
    relative : TrajectoryErrors, optional
        Errors of motions, drawn as points at the ends of the motions.
    apart : str
        Distance of the poses of `relative`, for its title: ``"100 m"``.
    times : (n,) [s], optional
        Times for the horizontal axis of the errors; the length of the true path by default.
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
    drawn = {"absolute error (APE)": errors}
    if relative is not None:
        drawn[f"relative error{f' over {apart}' if apart else ''} (RPE)"] = relative
    figure = blank_figure(7.0 + 3.6 * len(drawn), 5.6)
    if title:
        figure.suptitle(title, fontsize=12, color=INK)
    grid = figure.add_gridspec(2, 1 + len(drawn), width_ratios=(1.6, *([1.0] * len(drawn))))
    above = figure.add_subplot(grid[:, 0])
    both = positions(truth), positions(aligned(estimate, truth, alignment))
    _draw_paths(figure, above, *both, errors.translations)
    along = path_lengths(truth) if times is None else times - times[0]
    label = "true path length [m]" if times is None else "time [s]"
    for column, (name, one) in enumerate(drawn.items(), start=1):
        upper, lower = (figure.add_subplot(grid[row, column]) for row in range(2))
        for axes, values in ((upper, one.translations), (lower, np.degrees(one.rotations))):
            if one is relative:
                axes.plot(along[one.last], values, color=BLUE, marker=".", ms=3, linewidth=0)
            else:
                axes.plot(along[one.last], values, color=VERMILION, linewidth=1.2)
            axes.set_ylim(bottom=0.0)
        upper.set_title(name, fontsize=9, color=INK)
        _format(upper, "", "translation [m]")
        _format(lower, label, "rotation [deg]")
    return figure


def _draw_paths(
    figure: "Figure", axes: "Axes", true: Points, estimated: Points, errors: Vector
) -> None:
    """Draw both paths from above, the estimate coloured by its errors [m]."""
    from matplotlib import colormaps
    from matplotlib.collections import LineCollection
    from matplotlib.colors import LinearSegmentedColormap, Normalize

    across, up = _view_axes(true)
    axes.plot(
        true[:, across], true[:, up], color=_TRUE_COLOUR, linewidth=_TRUE_WIDTH, label="truth"
    )
    part = colormaps[_COLOURS](np.linspace(*_COLOUR_RANGE, 256))
    colours = LinearSegmentedColormap.from_list("visible", part.tolist())
    path = estimated[:, (across, up)]
    sections = np.stack([path[:-1], path[1:]], axis=1)
    norm = Normalize(0.0, max(float(errors.max()), 1e-9))
    lines = LineCollection(
        list(sections), cmap=colours, norm=norm, linewidths=1.6, capstyle="round"
    )
    lines.set_array(errors[1:])
    axes.add_collection(lines)
    # Limits ignore collections, so an invisible line follows the path.
    axes.plot(path[:, 0], path[:, 1], linewidth=0)
    axes.plot(*true[0, (across, up)], color=INK, marker="o", ms=5)
    axes.set_aspect("equal", adjustable="datalim")
    axes.legend(loc="best", fontsize=8, frameon=False, labelcolor=INK)
    _format(axes, f"{'xyz'[across]} [m]", f"{'xyz'[up]} [m]")
    bar = figure.colorbar(lines, ax=axes, shrink=0.6, pad=0.015)
    bar.set_label("absolute translation error [m]", fontsize=8, color=INK)
    bar.ax.tick_params(labelsize=8)


def _view_axes(points: Points) -> tuple[int, int]:
    """Return the two axes to draw: x and y, or x and z where y is the vertical axis."""
    x, y, z = np.ptp(points, axis=0).tolist()
    is_forward = z > _MIN_FORWARD_RATIO * max(x, y) and z > y
    return (0, 2) if is_forward else (0, 1)


def _format(axes: "Axes", horizontal: str, vertical: str) -> None:
    axes.set_xlabel(horizontal, fontsize=8, color=FAINT)
    axes.set_ylabel(vertical, fontsize=8, color=FAINT)
    axes.tick_params(labelsize=8, colors=FAINT, length=2)
    axes.grid(color="#eeeeee", linewidth=0.6)
    axes.set_axisbelow(True)
    for spine in axes.spines.values():
        spine.set_color("#cccccc")
