"""Figure of pairs of scans from above, each at several poses."""

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
    close_up_corner,
    legend_below,
    overlay,
    set_map_view,
    window_around,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SIDE = 16.0
"""Side of the displayed square [m], in which single plants are visible."""


@dataclass(frozen=True, slots=True, eq=False)
class Alignment:
    """Two scans at several poses.

    Attributes
    ----------
    title : str
        Name of the pair.
    target : (n, 3) [m]
        Points of the target.
    sources : mapping of str to (m, 3) [m]
        Points of the source in the frame of the target, by the name of the pose.
    """

    title: str
    target: Points
    sources: Mapping[str, Points]


def alignment_figure(alignments: Sequence[Alignment]) -> "Figure":
    """Return a figure with one row per pair and one column per pose.

    All views of a row show the same square, chosen by the last pose.

    Raises
    ------
    MissingExtra
        Matplotlib is not installed.
    InvalidInput
        There is no pair, or the pairs have different numbers of poses.
    """
    counts = {len(alignment.sources) for alignment in alignments}
    if len(counts) != 1 or 0 in counts:
        raise InvalidInput(
            f"all pairs must have the same number of poses, at least 1, got {sorted(counts)}"
        )
    columns = counts.pop()
    figure = blank_figure(3.2 * columns, 3.5 * len(alignments) + 0.3)
    grid = figure.subplots(len(alignments), columns, squeeze=False)
    for row, alignment in zip(grid, alignments, strict=True):
        last = [*alignment.sources.values()][-1]
        centre, half = window_around(alignment.target[:, :2])
        corner = close_up_corner([alignment.target, last], centre, half, _SIDE)
        for axes, (name, source) in zip(row, alignment.sources.items(), strict=True):
            overlay(axes, alignment.target, source, 3.0)
            labels = ("x [m]", "y [m]" if axes is row[0] else "")
            set_map_view(axes, corner + 0.5 * _SIDE, 0.5 * _SIDE, labels)
            axes.set_title(f"{alignment.title}\n{name}", fontsize=9, color=INK)
    legend_below(figure, {"target": BLUE, "source": VERMILION})
    return figure
