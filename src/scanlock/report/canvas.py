"""Shared elements of all figures: colours, blank figures, map views in metres, files."""

import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector
from scanlock.errors import InvalidInput, missing_extra
from scanlock.io import atomic_file

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK = "#222222"
FAINT = "#8a8a8a"
GROUND = "#c9c4ba"
BLUE = "#0072b2"
VERMILION = "#d55e00"
CATEGORIES = (
    "#0072b2",
    "#d55e00",
    "#009e73",
    "#cc79a7",
    "#56b4e9",
    "#e69f00",
    "#5d3a9b",
    "#7a5230",
)
"""Colours for all common kinds of colour vision (Okabe and Ito, and two darker ones)."""

ALARM = "#b00020"

FIGURE_ENDINGS = (".png", ".pdf", ".svg")

_DPI = 150
_GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0
_MAX_POINTS = 60_000
"""Maximum number of points in a view; more only cover each other."""

_CELL = 0.5
"""Size of the cells in which surface is counted [m]."""

_MIN_HEIGHT = 0.7
"""Minimum height range of a cell with an object [m]."""

_FULL_COUNT = 40.0
"""Number of points from which a cell has the maximum score."""

_FLAT_WEIGHT = 1e-3
"""Weight of cells without an object."""

_METADATA: dict[str, dict[str, Any]] = {
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
    "png": {"Software": None},
    "svg": {"Date": None, "Creator": None},
}
"""Metadata with version and date, removed so that equal figures have equal bytes."""


def require_figures() -> None:
    """Raise `MissingExtra` unless Matplotlib can be imported."""
    try:
        import matplotlib  # noqa: F401  # pyright: ignore[reportUnusedImport]
    except ImportError as error:
        raise missing_extra("figures need Matplotlib", "figures") from error


def blank_figure(width: float, height: float) -> "Figure":
    """Return an empty figure [inch] without a window and without global state."""
    require_figures()
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), dpi=_DPI, facecolor="white", layout="constrained")


def save_figure(path: str | os.PathLike[str], figure: "Figure") -> None:
    """Write a figure in the format of the file name ending, one of `FIGURE_ENDINGS`.

    Raises
    ------
    InvalidInput
        The ending is not supported.
    FileNotFoundError
        The folder does not exist.
    """
    ending = Path(path).suffix.lower()
    if ending not in FIGURE_ENDINGS:
        raise InvalidInput(
            f"a figure file must end in {', '.join(FIGURE_ENDINGS)}, got {os.fspath(path)!r}"
        )
    suffix = ending.removeprefix(".")
    from matplotlib import rc_context

    # The ids in an SVG are random without a salt.
    with rc_context({"svg.hashsalt": Path(path).stem}), atomic_file(path) as handle:
        figure.savefig(handle, format=suffix, metadata=_METADATA[suffix])


def downsampled_rows(count: int) -> Labels:
    """Return every k-th of `count` rows, at most the maximum number of points of a view."""
    return np.arange(0, count, max(1, -(-count // _MAX_POINTS)))


def window_around(*views: Matrix, percentile: float = 97.0) -> tuple[Vector, float]:
    """Return centre and half side [m] of a square around most (n, 2) points.

    The square ends at a percentile of the coordinates; a few points are far away.
    """
    points = np.concatenate([view for view in views if len(view)] or [np.zeros((1, 2))])
    low, high = np.percentile(points, [100.0 - percentile, percentile], axis=0)
    half = 0.5 * float((high - low).max())
    return 0.5 * (low + high), max(1.08 * half, 1.0)


def set_map_view(axes: "Axes", centre: Vector, half: float, labels: Sequence[str]) -> None:
    """Format axes as a square map in metres with few ticks."""
    from matplotlib.ticker import MaxNLocator

    axes.set_aspect("equal", adjustable="box")
    axes.set_xlim(centre[0] - half, centre[0] + half)
    axes.set_ylim(centre[1] - half, centre[1] + half)
    for axis, label in zip((axes.xaxis, axes.yaxis), labels, strict=True):
        axis.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 5, 10]))
        axis.set_label_text(label, fontsize=8, color=FAINT)
    axes.tick_params(labelsize=8, colors=FAINT, length=2)
    axes.grid(color="#eeeeee", linewidth=0.6)
    axes.set_axisbelow(True)
    for spine in axes.spines.values():
        spine.set_color("#cccccc")


def close_up_corner(clouds: Sequence[Points], centre: Vector, half: float, side: float) -> Vector:
    """Return the lower left corner of the square with the most surface in all clouds.

    Cells with objects count fully, flat surfaces only in the absence of objects.

    Parameters
    ----------
    clouds : sequence of (n, 3) [m]
        Clouds in one frame; the score of a cell is the minimum over the clouds.
    centre, half : (2,), float [m]
        Searched part of the map, see `window_around`.
    side : float [m]
        Side of the square.
    """
    low = centre - half
    cells = max(1, math.ceil(2.0 * half / _CELL))
    span = min(cells, max(1, int(side / _CELL)))
    scores = np.minimum.reduce([_cell_scores(points, low, cells) for points in clouds])
    sums = np.pad(scores.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    inside = sums[span:, span:] - sums[:-span, span:] - sums[span:, :-span] + sums[:-span, :-span]
    best = np.unravel_index(int(inside.argmax()), inside.shape)
    return low + _CELL * np.array(best, dtype=np.float64)


def _cell_scores(points: Points, low: Vector, cells: int) -> Matrix:
    """Return scores up to 1 of cells with an object, and much smaller ones of the others."""
    index = np.floor((points[:, :2] - low) / _CELL).astype(np.int64)
    inside = ((index >= 0) & (index < cells)).all(axis=1)
    flat = index[inside, 0] * cells + index[inside, 1]
    lowest, highest = np.full(cells * cells, np.inf), np.full(cells * cells, -np.inf)
    np.minimum.at(lowest, flat, points[inside, 2])
    np.maximum.at(highest, flat, points[inside, 2])
    scores = np.minimum(np.bincount(flat, minlength=cells * cells) / _FULL_COUNT, 1.0)
    scores[~(highest - lowest > _MIN_HEIGHT)] *= _FLAT_WEIGHT
    return scores.reshape(cells, cells)


def draw_frame(axes: "Axes", corner: Vector, side: float) -> None:
    """Draw the outline of the close-up on a map."""
    from matplotlib.patches import Rectangle

    axes.add_patch(
        Rectangle((corner[0], corner[1]), side, side, fill=False, edgecolor=INK, linewidth=0.9)
    )


def scatter(axes: "Axes", view: Matrix, colours: Any, *, size: float) -> None:
    """Draw (n, 2) points as dots without edges, rasterised inside vector files."""
    axes.scatter(view[:, 0], view[:, 1], s=size, c=colours, linewidths=0, rasterized=True)


def interleaved_order(count: int) -> Labels:
    """Return a fixed order of `count` points that spreads every contiguous part evenly.

    Drawn in this order, neither of two aligned clouds covers the other.
    """
    return np.argsort(np.arange(count) * _GOLDEN % 1.0, kind="stable").astype(np.int64)


def overlay(axes: "Axes", target: Points, source: Points, size: float) -> None:
    """Draw two clouds in one frame from above, the target blue and the source vermilion."""
    target, source = (one[downsampled_rows(len(one))] for one in (target, source))
    views = np.concatenate([target[:, :2], source[:, :2]])
    colours = np.repeat([BLUE, VERMILION], [len(target), len(source)])
    order = interleaved_order(len(views))
    scatter(axes, views[order], colours[order], size=size)


def legend_below(figure: "Figure", colours: Mapping[str, str]) -> None:
    """Draw one legend of the colours below all views."""
    from matplotlib.lines import Line2D

    marks = [
        Line2D([], [], linestyle="none", marker="o", markersize=5, color=colour, label=name)
        for name, colour in colours.items()
    ]
    figure.legend(
        handles=marks,
        loc="outside lower center",
        ncols=len(marks),
        fontsize=9,
        frameon=False,
        labelcolor=INK,
        handletextpad=0.1,
    )
