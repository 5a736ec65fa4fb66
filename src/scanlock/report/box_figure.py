"""Figure of box plots of the errors of several methods, as Figure 3 of Das et al. 2013."""

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
_MIN_LOG_FACTOR = 10.0
"""Minimum ratio of the extreme values for a logarithmic scale."""


@dataclass(frozen=True, slots=True, eq=False)
class BoxPanel:
    """Group of box plots.

    Attributes
    ----------
    title : str
        Title with the unit.
    values : mapping of str to (n,)
        Values by method; non-finite values are counted below the box, not drawn.
    """

    title: str
    values: Mapping[str, Vector]


def box_figure(panels: Sequence[BoxPanel]) -> "Figure":
    """Return a figure with one panel of box plots per group.

    Boxes span the quartiles with a line at the median. Whiskers end at the last value within 1.5
    times the box height, and values beyond are drawn as points. The scale is logarithmic if the
    values span more than a decade.

    Raises
    ------
    MissingExtra
        Matplotlib is not installed.
    InvalidInput
        There is no panel, or a panel has no method.
    """
    if not panels or not all(panel.values for panel in panels):
        raise InvalidInput("a box plot needs at least one panel, and at least one method per panel")
    columns = max(len(panel.values) for panel in panels)
    figure = blank_figure(len(panels) * (1.2 + 0.75 * max(columns, 4)), 4.6)
    for axes, panel in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
        _draw(axes, panel)
    return figure


def _draw(axes: "Axes", panel: BoxPanel) -> None:
    names = [*panel.values]
    finite = [values[np.isfinite(values)] for values in panel.values.values()]
    for place, values in enumerate(finite, start=1):
        if len(values):
            _draw_box(axes, place, values)
    every = np.concatenate(finite)
    positive = every[every > 0.0]
    if len(positive) and positive.max() > _MIN_LOG_FACTOR * positive.min():
        axes.set_yscale("log", nonpositive="clip")
    elif len(every):
        axes.set_ylim(bottom=0.0)
    axes.set_title(panel.title, fontsize=11, color=INK)
    labels = [
        _label(name, len(values) - len(drawn))
        for (name, values), drawn in zip(panel.values.items(), finite, strict=True)
    ]
    axes.set_xlim(0.4, len(names) + 0.6)
    axes.set_xticks(range(1, len(names) + 1), labels, rotation=30, ha="right", fontsize=9)
    axes.tick_params(axis="y", labelsize=8, colors=FAINT, which="both")
    axes.grid(axis="y", color="#eeeeee", linewidth=0.6)
    axes.set_axisbelow(True)
    for spine in axes.spines.values():
        spine.set_color("#cccccc")


def _draw_box(axes: "Axes", place: int, values: Vector) -> None:
    # The box plot of Matplotlib imports pyplot, which looks for a screen.
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
