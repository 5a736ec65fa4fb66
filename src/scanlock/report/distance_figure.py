"""Figure of the distances of closest points before and after a registration."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from scanlock.arrays import Vector
from scanlock.errors import InvalidInput
from scanlock.report.canvas import CATEGORIES, FAINT, INK, blank_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MIN_DISTANCE = 1e-3
"""Minimum distance on the logarithmic scale [m]; smaller ones are drawn there."""


@dataclass(frozen=True, slots=True)
class DistancePanel:
    """Distances of one pair of scans.

    Attributes
    ----------
    title : str
    distances : mapping of str to (n,) [m]
        Distances of all points in scan order to the closest point of the other scan, by pose.
    """

    title: str
    distances: Mapping[str, Vector]


def distance_figure(panels: Sequence[DistancePanel]) -> "Figure":
    """Return a figure with the distance of each point, one panel per pair.

    Raises
    ------
    MissingExtra
        Matplotlib is not installed.
    InvalidInput
        There is no panel, or a panel has no distances.
    """
    if not panels or not all(panel.distances for panel in panels):
        raise InvalidInput("distances need at least one panel, and at least one array per panel")
    figure = blank_figure(9.0, 2.7 * len(panels))
    for axes, panel in zip(
        figure.subplots(len(panels), 1, squeeze=False)[:, 0], panels, strict=True
    ):
        _draw(axes, panel)
    return figure


def _draw(axes: "Axes", panel: DistancePanel) -> None:
    colours = [FAINT, *CATEGORIES]
    for colour, (name, distances) in zip(colours, panel.distances.items(), strict=False):
        shown = np.maximum(distances, _MIN_DISTANCE)
        mean = f"{name}: mean {100.0 * distances.mean():.1f} cm"
        axes.plot(
            shown, linestyle="none", marker="o", markersize=1.3, mew=0, color=colour, label=mean,
            rasterized=True,
        )  # fmt: skip
    axes.set_yscale("log")
    axes.set_title(panel.title, fontsize=10, color=INK)
    axes.set_xlabel("point in scan order", fontsize=8, color=FAINT)
    axes.set_ylabel("distance to the closest point [m]", fontsize=8, color=FAINT)
    axes.tick_params(labelsize=8, colors=FAINT, length=2)
    axes.legend(fontsize=8, loc="upper right", markerscale=4.0, labelcolor=INK, framealpha=0.9)
    for spine in axes.spines.values():
        spine.set_color("#cccccc")
