"""One scan in its ground and clusters: all of it from above, and a close look at one place."""

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
    frame,
    legend_below,
    richest_square,
    scatter,
    square_view,
    thinned_rows,
    window_around,
)
from scanlock.segmentation.ground.finder import GroundStatus
from scanlock.segmentation.segmentation import GROUND as GROUND_LABEL
from scanlock.segmentation.segmentation import LEFT_OUT, Segmentation

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_CLOSE_UP = 0.3
"""Side of the close-up over that of the whole view."""

_AZIMUTH, _ELEVATION = math.radians(15.0), math.radians(48.0)
"""Where the close-up is looked at from [rad]: turned to the side, and above the horizon."""


def segmentation_figure(segmentation: Segmentation) -> "Figure":
    """Return a figure of a segmented scan: ground in grey, each cluster in one of a few colours.

    Neighbouring clusters may share a colour by chance; points that are neither ground nor in a
    cluster are small and grey.

    Raises
    ------
    MissingExtra
        Matplotlib is not installed.
    """
    figure = blank_figure(10.5, 6.2)
    cloud = segmentation.cloud
    labels = segmentation.labels[cloud.rows]
    standing = cloud.points[labels > GROUND_LABEL]
    middle, half = window_around((standing if len(standing) else cloud.points)[:, :2])
    side = 2.0 * half * _CLOSE_UP
    corner = richest_square([standing], middle, half, side)
    found = segmentation.ground.status is not GroundStatus.NONE
    figure.suptitle(_title(segmentation), fontsize=12, color=INK if found else ALARM)
    whole, close = figure.subplots(1, 2)
    _draw(whole, cloud.points, labels)
    square_view(whole, middle, half, ("x [m]", "y [m]"))
    whole.set_title("from above", fontsize=11, color=INK)
    frame(whole, corner, side)
    _draw_oblique(close, cloud.points, labels, corner, side)
    close.set_title("inside the frame, at a slant", fontsize=11, color=INK)
    legend_below(
        figure,
        {"ground": GROUND, "clusters, each in one colour": CATEGORIES[0], "neither": FAINT},
    )
    return figure


def _draw(axes: "Axes", points: Points, labels: Labels) -> None:
    rows = thinned_rows(len(points))
    # Ground first, so that what stands on it lies on top.
    rows = rows[np.argsort(labels[rows] != GROUND_LABEL, kind="stable")]
    scatter(axes, points[rows, :2], _colours(labels[rows]), size=0.5)


def _draw_oblique(
    axes: "Axes", points: Points, labels: Labels, corner: Vector, side: float
) -> None:
    inside = ((points[:, :2] >= corner) & (points[:, :2] <= corner + side)).all(axis=1)
    points, labels = points[inside], labels[inside]
    rows = thinned_rows(len(points))
    points, labels = points[rows], labels[rows]
    plan = (points[:, :2] - corner - 0.5 * side) @ _turn(_AZIMUTH)
    order = np.argsort(-plan[:, 1], kind="stable")
    view = np.column_stack(
        [plan[:, 0], plan[:, 1] * math.sin(_ELEVATION) + points[:, 2] * math.cos(_ELEVATION)]
    )
    scatter(axes, view[order], _colours(labels[order]), size=2.0)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_box_aspect(1.0)
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set_color("#cccccc")


def _turn(angle: float) -> Matrix:
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
    share = 100.0 * float(ground.is_ground.mean())
    return f"ground ({share:.0f} % of the points) and {segmentation.cluster_count} clusters"
