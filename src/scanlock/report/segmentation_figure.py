"""Figure of a segmented scan: ground and clusters from above, and as a close-up."""

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Labels, Matrix, Points, Vector
from scanlock.report.canvas import (
    ALARM,
    CATEGORIES,
    FAINT,
    GROUND,
    INK,
    blank_figure,
    close_up_corner,
    downsampled_rows,
    draw_frame,
    legend_below,
    scatter,
    set_map_view,
    window_around,
)
from scanlock.segmentation.ground.finder import GroundStatus
from scanlock.segmentation.segmentation import GROUND as GROUND_LABEL
from scanlock.segmentation.segmentation import LEFT_OUT, Segmentation

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_CLOSE_UP = 0.3
"""Ratio of the side of the close-up to that of the whole view."""

_AZIMUTH, _ELEVATION = math.radians(15.0), math.radians(48.0)
"""Azimuth and elevation of the view of the close-up [rad]."""


def segmentation_figure(segmentation: Segmentation) -> "Figure":
    """Return a figure of a segmented scan with grey ground and coloured clusters.

    Neighbouring clusters may have the same colour. Points that are neither ground nor in a
    cluster are dark grey.

    Raises
    ------
    MissingExtra
        Matplotlib is not installed.
    """
    figure = blank_figure(10.5, 6.2)
    cloud = segmentation.cloud
    labels = segmentation.labels[cloud.rows]
    obstacles = cloud.points[labels > GROUND_LABEL]
    centre, half = window_around((obstacles if len(obstacles) else cloud.points)[:, :2])
    side = 2.0 * half * _CLOSE_UP
    corner = close_up_corner([obstacles], centre, half, side)
    found = segmentation.ground.status is not GroundStatus.NONE
    figure.suptitle(_title(segmentation), fontsize=12, color=INK if found else ALARM)
    whole, close = figure.subplots(1, 2)
    _draw(whole, cloud.points, labels)
    set_map_view(whole, centre, half, ("x [m]", "y [m]"))
    whole.set_title("from above", fontsize=11, color=INK)
    draw_frame(whole, corner, side)
    _draw_oblique(close, cloud.points, labels, corner, side)
    close.set_title("inside the frame, oblique view", fontsize=11, color=INK)
    legend_below(
        figure,
        {"ground": GROUND, "clusters, each in one colour": CATEGORIES[0], "neither": FAINT},
    )
    return figure


def _draw(axes: "Axes", points: Points, labels: Labels) -> None:
    rows = downsampled_rows(len(points))
    # Ground first, below the clusters.
    rows = rows[np.argsort(labels[rows] != GROUND_LABEL, kind="stable")]
    scatter(axes, points[rows, :2], _colours(labels[rows]), size=0.5)


def _draw_oblique(
    axes: "Axes", points: Points, labels: Labels, corner: Vector, side: float
) -> None:
    inside = ((points[:, :2] >= corner) & (points[:, :2] <= corner + side)).all(axis=1)
    points, labels = points[inside], labels[inside]
    rows = downsampled_rows(len(points))
    points, labels = points[rows], labels[rows]
    rotated = (points[:, :2] - corner - 0.5 * side) @ _rotation(_AZIMUTH)
    order = np.argsort(-rotated[:, 1], kind="stable")
    view = np.column_stack(
        [rotated[:, 0], rotated[:, 1] * math.sin(_ELEVATION) + points[:, 2] * math.cos(_ELEVATION)]
    )
    scatter(axes, view[order], _colours(labels[order]), size=2.0)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_box_aspect(1.0)
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set_color("#cccccc")


def _rotation(angle: float) -> Matrix:
    return np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])


def _colours(labels: Labels) -> NDArray[np.str_]:
    colours = np.array(CATEGORIES)[(labels - 1) % len(CATEGORIES)]
    colours[labels == GROUND_LABEL] = GROUND
    colours[labels == LEFT_OUT] = FAINT
    return colours


def _title(segmentation: Segmentation) -> str:
    ground = segmentation.ground
    if ground.status is GroundStatus.NONE:
        return f"{segmentation.cluster_count} clusters, no ground: {ground.reason}"
    percent = 100.0 * float(ground.is_ground.mean())
    return f"ground ({percent:.0f} % of the points) and {segmentation.cluster_count} clusters"
