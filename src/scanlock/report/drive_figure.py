"""The map of a drive from above, coloured by height, with the way of the sensor through it."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from scanlock.arrays import Matrix, Points, Vector
from scanlock.errors import InvalidInput
from scanlock.report.canvas import (
    ALARM,
    INK,
    blank_figure,
    square_view,
    window_around,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PIXELS = 1000
"""Pixels along the side of the map; each shows the highest of its points."""

_COLOURS = "viridis"
_COLOURED_SHARE = 96.0
"""Colours span this percentage of the heights: birds and holes would take up all of them."""

_MARGIN = 1.06


def drive_figure(
    points: Points, path: Points, *, doubtful: Sequence[int] = (), title: str = ""
) -> "Figure":
    """Return a figure of a map from above: the highest point of each pixel, coloured by height.

    Parameters
    ----------
    points : (n, 3) [m]
        The map; any number of points costs one pass over them.
    path : (k, 3) [m]
        Where the sensor was, in the frame of the map.
    doubtful : sequence of int
        Rows of `path` whose motion from the row before is not to be trusted; those stretches are
        drawn in red.
    title : str
        What to say above the map, in red where a motion is in doubt.

    Raises
    ------
    MissingExtra
        Matplotlib is not installed.
    InvalidInput
        A map without points, or a path without places.
    """
    if len(points) == 0 or len(path) == 0:
        raise InvalidInput(
            f"a figure of a drive needs points and a path, got {len(points)} and {len(path)} rows"
        )
    figure = blank_figure(8.4, 7.6)
    axes = figure.subplots()
    middle, half = _window(points, path)
    heights = _highest(points, middle, half)
    _shade(figure, axes, heights, middle, half)
    axes.plot(path[:, 0], path[:, 1], color="white", linewidth=3.0)
    axes.plot(path[:, 0], path[:, 1], color=INK, linewidth=1.4)
    for row in doubtful:
        stretch = path[max(row - 1, 0) : row + 1]
        axes.plot(stretch[:, 0], stretch[:, 1], color=ALARM, linewidth=2.4, marker="o", ms=4)
    axes.plot(*path[0, :2], color=INK, marker="o", ms=5, mec="white")
    square_view(axes, middle, half, ("x [m]", "y [m]"))
    if title:
        axes.set_title(title, fontsize=11, color=ALARM if len(doubtful) else INK)
    return figure


def _window(points: Points, path: Points) -> tuple[Vector, float]:
    """Return the middle and half the side [m] of what is shown: nearly all, and all of the path."""
    middle, half = window_around(points[:, :2], path[:, :2])
    farthest = float(np.abs(path[:, :2] - middle).max())
    return middle, max(half, _MARGIN * farthest)


def _highest(points: Points, middle: Vector, half: float) -> Matrix:
    """Return the (rows, columns) greatest heights [m], rows along y; NaN where there is nothing."""
    index = np.floor((points[:, :2] - middle + half) * (_PIXELS / (2.0 * half))).astype(np.int64)
    inside = ((index >= 0) & (index < _PIXELS)).all(axis=1)
    heights = np.full(_PIXELS * _PIXELS, -np.inf)
    np.maximum.at(heights, index[inside, 1] * _PIXELS + index[inside, 0], points[inside, 2])
    heights[np.isneginf(heights)] = np.nan
    return heights.reshape(_PIXELS, _PIXELS)


def _shade(figure: "Figure", axes: "Axes", heights: Matrix, middle: Vector, half: float) -> None:
    seen = heights[np.isfinite(heights)]
    tail = 0.5 * (100.0 - _COLOURED_SHARE)
    low, high = np.percentile(seen, [tail, 100.0 - tail]) if len(seen) else (0.0, 1.0)
    image = axes.imshow(
        heights,
        cmap=_COLOURS,
        origin="lower",
        extent=(middle[0] - half, middle[0] + half, middle[1] - half, middle[1] + half),
        interpolation="nearest",
        vmin=low,
        vmax=high,
    )
    bar = figure.colorbar(image, ax=axes, shrink=0.6, pad=0.015)
    bar.set_label("height in the frame of the first scan [m]", fontsize=8, color=INK)
    bar.ax.tick_params(labelsize=8)
