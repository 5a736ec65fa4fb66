"""What all figures share: colours, a blank page, a map view in metres, and the way to a file."""

import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector
from scanlock.errors import InvalidInput, MissingExtra
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
"""Told apart with every common kind of colour vision (Okabe and Ito, and two darker ones)."""

ALARM = "#b00020"

FIGURE_ENDINGS = (".png", ".pdf", ".svg")

_DPI = 150
_GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0
_MOST_POINTS = 60_000
"""More points than this in one view only cover each other."""

_CELL = 0.5
"""Side of the cells [m] that tell where there is surface to see."""

_UPRIGHT = 0.7
"""Something stands in a cell with points this far above each other [m]."""

_RICH = 40.0
"""Points that make a cell as good to look at as can be."""

_LEVEL_WORTH = 1e-3

_SHOWN_SHARE = 97.0
"""A view ends where this percentage of the points lies inside: the rest are a few far ones."""


_METADATA: dict[str, dict[str, Any]] = {
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
    "png": {"Software": None},
    "svg": {"Date": None, "Creator": None},
}
"""What Matplotlib would write of itself and the day; without it, the same scans give the same
bytes."""


def require_figures() -> None:
    """Raise `MissingExtra` unless Matplotlib can be imported."""
    try:
        import matplotlib  # noqa: F401  # pyright: ignore[reportUnusedImport]
    except ImportError as error:
        raise MissingExtra(
            'figures need Matplotlib; install it with: pip install "scanlock[figures]"'
        ) from error


def blank_figure(width: float, height: float) -> "Figure":
    """Return an empty page [inch] that belongs to no window and to no global state."""
    require_figures()
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), dpi=_DPI, facecolor="white", layout="constrained")


def save_figure(path: str | os.PathLike[str], figure: "Figure") -> None:
    """Write a figure as the ending of the name says, one of `FIGURE_ENDINGS`.

    Raises
    ------
    InvalidInput
        Another ending.
    FileNotFoundError
        The folder does not exist.
    """
    ending = Path(path).suffix.lower()
    if ending not in FIGURE_ENDINGS:
        raise InvalidInput(
            f"a picture must end in {', '.join(FIGURE_ENDINGS)}, got {os.fspath(path)!r}"
        )
    suffix = ending.removeprefix(".")
    from matplotlib import rc_context

    # The names of an SVG's parts are drawn anew each time unless they are salted.
    with rc_context({"svg.hashsalt": Path(path).stem}), atomic_file(path) as handle:
        figure.savefig(handle, format=suffix, metadata=_METADATA[suffix])


def thinned_rows(count: int) -> Labels:
    """Return every k-th of `count` rows, so that no view holds more than it can show."""
    return np.arange(0, count, max(1, -(-count // _MOST_POINTS)))


def window_around(*views: Matrix) -> tuple[Vector, float]:
    """Return the middle and half the side [m] of a square that holds nearly all (n, 2) points."""
    places = np.concatenate([view for view in views if len(view)] or [np.zeros((1, 2))])
    low, high = np.percentile(places, [100.0 - _SHOWN_SHARE, _SHOWN_SHARE], axis=0)
    half = 0.5 * float((high - low).max())
    return 0.5 * (low + high), max(1.08 * half, 1.0)


def square_view(axes: "Axes", middle: Vector, half: float, labels: Sequence[str]) -> None:
    """Dress axes as a square map in metres around a middle, with as few marks as it takes."""
    from matplotlib.ticker import MaxNLocator

    axes.set_aspect("equal", adjustable="box")
    axes.set_xlim(middle[0] - half, middle[0] + half)
    axes.set_ylim(middle[1] - half, middle[1] + half)
    for axis, label in zip((axes.xaxis, axes.yaxis), labels, strict=True):
        axis.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 5, 10]))
        axis.set_label_text(label, fontsize=8, color=FAINT)
    axes.tick_params(labelsize=8, colors=FAINT, length=2)
    axes.grid(color="#eeeeee", linewidth=0.6)
    axes.set_axisbelow(True)
    for spine in axes.spines.values():
        spine.set_color("#cccccc")


def richest_square(clouds: Sequence[Points], middle: Vector, half: float, side: float) -> Vector:
    """Return the lower left corner of the square where all clouds together show most surface.

    What stands upright is worth looking at, from above as well; level surfaces decide only
    where nothing stands.

    Parameters
    ----------
    clouds : sequence of (n, 3) [m]
        A cell of the map counts for what the cloud with the least in it shows there.
    middle, half : (2,), float [m]
        The map to look in; see `window_around`.
    side : float [m]
        Side of the square looked for.
    """
    low = middle - half
    cells = max(1, math.ceil(2.0 * half / _CELL))
    span = min(cells, max(1, int(side / _CELL)))
    worth = np.minimum.reduce([_worth(points, low, cells) for points in clouds])
    sums = np.pad(worth.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    inside = sums[span:, span:] - sums[:-span, span:] - sums[span:, :-span] + sums[:-span, :-span]
    place = np.unravel_index(int(inside.argmax()), inside.shape)
    return low + _CELL * np.array(place, dtype=np.float64)


def _worth(points: Points, low: Vector, cells: int) -> Matrix:
    """Return up to 1 for each cell of a map with something upright, much less for the others."""
    index = np.floor((points[:, :2] - low) / _CELL).astype(np.int64)
    kept = ((index >= 0) & (index < cells)).all(axis=1)
    flat = index[kept, 0] * cells + index[kept, 1]
    lowest, highest = np.full(cells * cells, np.inf), np.full(cells * cells, -np.inf)
    np.minimum.at(lowest, flat, points[kept, 2])
    np.maximum.at(highest, flat, points[kept, 2])
    worth = np.minimum(np.bincount(flat, minlength=cells * cells) / _RICH, 1.0)
    worth[~(highest - lowest > _UPRIGHT)] *= _LEVEL_WORTH
    return worth.reshape(cells, cells)


def frame(axes: "Axes", corner: Vector, side: float) -> None:
    """Mark a square of a map, the part that another view shows closer."""
    from matplotlib.patches import Rectangle

    axes.add_patch(
        Rectangle((corner[0], corner[1]), side, side, fill=False, edgecolor=INK, linewidth=0.9)
    )


def scatter(axes: "Axes", view: Matrix, colours: Any, *, size: float) -> None:
    """Draw (n, 2) points as dots without edges, as an image inside vector files."""
    axes.scatter(view[:, 0], view[:, 1], s=size, c=colours, linewidths=0, rasterized=True)


def mingled(count: int) -> Labels:
    """Return an order of `count` things in which no part of them comes last, always the same.

    Drawn in this order, neither of two clouds that coincide hides the other.
    """
    return np.argsort(np.arange(count) * _GOLDEN % 1.0, kind="stable").astype(np.int64)


def overlay(axes: "Axes", fixed: Points, moved: Points, size: float) -> None:
    """Draw two clouds from above, in blue what stays and in vermilion what moves."""
    fixed, moved = fixed[thinned_rows(len(fixed))], moved[thinned_rows(len(moved))]
    views = np.concatenate([fixed[:, :2], moved[:, :2]])
    colours = np.repeat([BLUE, VERMILION], [len(fixed), len(moved)])
    order = mingled(len(views))
    scatter(axes, views[order], colours[order], size=size)


def legend_below(figure: "Figure", colours: Mapping[str, str]) -> None:
    """Say once, in a row below the views, which colour is what."""
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
