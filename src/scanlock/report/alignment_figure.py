"""Pairs of scans from above, each at several poses side by side."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from scanlock.arrays import Points
from scanlock.errors import InvalidInput
from scanlock.report.canvas import (
    BLUE,
    INK,
    VERMILION,
    blank_figure,
    legend_below,
    overlay,
    richest_square,
    square_view,
    window_around,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SIDE = 16.0
"""Side of the part that is shown [m]: enough to see single plants."""


@dataclass(frozen=True, slots=True, eq=False)
class Alignment:
    """Two scans at several poses.

    Attributes
    ----------
    title : str
        What is registered.
    target : (n, 3) [m]
        What stays.
    moved : mapping of str to (m, 3) [m]
        The source in the frame of the target, by how it came there.
    """

    title: str
    target: Points
    moved: Mapping[str, Points]


def alignment_figure(alignments: Sequence[Alignment]) -> "Figure":
    """Return a figure with a row for each pair and a column for each of its poses.

    Every row shows one square of the map, where the last pose of the row leaves most to see.

    Raises
    ------
    MissingExtra
        Matplotlib is not installed.
    InvalidInput
        No pair, or pairs with different numbers of poses.
    """
    widths = {len(alignment.moved) for alignment in alignments}
    if len(widths) != 1 or 0 in widths:
        raise InvalidInput(
            f"pairs must have as many poses as each other, got {sorted(widths)} poses"
        )
    columns = widths.pop()
    figure = blank_figure(3.2 * columns, 3.5 * len(alignments) + 0.3)
    grid = figure.subplots(len(alignments), columns, squeeze=False)
    for row, alignment in zip(grid, alignments, strict=True):
        last = [*alignment.moved.values()][-1]
        middle, half = window_around(alignment.target[:, :2])
        corner = richest_square([alignment.target, last], middle, half, _SIDE)
        for axes, (name, moved) in zip(row, alignment.moved.items(), strict=True):
            overlay(axes, alignment.target, moved, 3.0)
            labels = ("x [m]", "y [m]" if axes is row[0] else "")
            square_view(axes, corner + 0.5 * _SIDE, 0.5 * _SIDE, labels)
            axes.set_title(f"{alignment.title}\n{name}", fontsize=9, color=INK)
    legend_below(figure, {"model (stays)": BLUE, "data (moves)": VERMILION})
    return figure
