"""Box plots of the errors of several methods, as Figure 3 of Das et al. 2013."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from scanlock.arrays import Vector
from scanlock.errors import InvalidInput
from scanlock.evaluation.box_plot import box_plot
from scanlock.report.canvas import BLUE, FAINT, INK, VERMILION, blank_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_HALF_WIDTH = 0.28
_FILL = "#d6e6f2"
_STRAIGHT_FACTOR = 10.0
"""Errors over fewer than this factor are drawn on a straight scale."""


@dataclass(frozen=True, slots=True, eq=False)
class BoxPanel:
    """One group of boxes.

    Attributes
    ----------
    title : str
        With the unit.
    values : mapping of str to (n,)
        Values by method; those that are not finite are counted at the foot, not drawn.
    """

    title: str
    values: Mapping[str, Vector]


def box_figure(panels: Sequence[BoxPanel]) -> "Figure":
    """Return a figure with one panel of box plots beside the other.

    Boxes reach from the lower to the upper quartile with a line at the median, whiskers to the
    last value within 1.5 times that height; what lies beyond is drawn one by one. Where values
    span more than a decade the scale is logarithmic.

    Raises
    ------
    MissingExtra
        Matplotlib is not installed.
    InvalidInput
        No panel, or one without a method.
    """
    if not panels or not all(panel.values for panel in panels):
        raise InvalidInput("a box plot needs a panel, and a method in each")
    most = max(len(panel.values) for panel in panels)
    figure = blank_figure(len(panels) * (1.2 + 0.75 * max(most, 4)), 4.6)
    for axes, panel in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
        _draw(axes, panel)
    return figure


def _draw(axes: "Axes", panel: BoxPanel) -> None:
    names = [*panel.values]
    kept = [values[np.isfinite(values)] for values in panel.values.values()]
    for place, values in enumerate(kept, start=1):
        if len(values):
            _draw_box(axes, place, values)
    drawn = np.concatenate(kept)
    positive = drawn[drawn > 0.0]
    if len(positive) and positive.max() > _STRAIGHT_FACTOR * positive.min():
        axes.set_yscale("log", nonpositive="clip")
    elif len(drawn):
        axes.set_ylim(bottom=0.0)
    axes.set_title(panel.title, fontsize=11, color=INK)
    labels = [
        _label(name, len(values) - len(finite))
        for (name, values), finite in zip(panel.values.items(), kept, strict=True)
    ]
    axes.set_xlim(0.4, len(names) + 0.6)
    axes.set_xticks(range(1, len(names) + 1), labels, rotation=30, ha="right", fontsize=9)
    axes.tick_params(axis="y", labelsize=8, colors=FAINT, which="both")
    axes.grid(axis="y", color="#eeeeee", linewidth=0.6)
    axes.set_axisbelow(True)
    for spine in axes.spines.values():
        spine.set_color("#cccccc")


def _draw_box(axes: "Axes", place: int, values: Vector) -> None:
    # Matplotlib's own box plot imports its state machine and looks for a screen.
    from matplotlib.patches import Rectangle

    box = box_plot(values)
    left, right = place - _HALF_WIDTH, place + _HALF_WIDTH
    height = box.upper_quartile - box.lower_quartile
    axes.add_patch(
        Rectangle((left, box.lower_quartile), right - left, height, facecolor=_FILL, edgecolor=BLUE)
    )
    for start, end in (
        (box.lower_quartile, box.lower_whisker),
        (box.upper_quartile, box.upper_whisker),
    ):
        axes.plot([place, place], [start, end], color=BLUE, linewidth=1.0)
        axes.plot([0.5 * (place + left), 0.5 * (place + right)], [end, end], color=BLUE, lw=1.0)
    axes.plot([left, right], [box.median, box.median], color=VERMILION, linewidth=1.6)
    axes.plot(
        np.full(len(box.outliers), place), box.outliers, linestyle="none", marker="o", markersize=3,
        markeredgecolor=INK, markerfacecolor="none", alpha=0.6,
    )  # fmt: skip


def _label(name: str, missing: int) -> str:
    return f"{name}\n({missing} failed)" if missing else name
