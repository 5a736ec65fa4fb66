"""Figure of the map of a drive from above, coloured by height, with the sensor path."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from scanlock.arrays import Matrix, Points, Vector
from scanlock.errors import InvalidInput
from scanlock.report.canvas import (
    ALARM,
    INK,
    blank_figure,
    set_map_view,
    window_around,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PIXELS = 1000
"""Number of pixels along a side; each shows its highest point."""

_COLOURS = "viridis"
_COLOURED_SHARE = 96.0
"""Percentage of the heights that the colours span, without outliers such as birds."""

_MARGIN = 1.06


def drive_figure(
    points: Points, path: Points, *, unverified: Sequence[int] = (), title: str = ""
) -> "Figure":
    """Return a figure of a map from above: the highest point of each pixel, coloured by height.

    Parameters
    ----------
    points : (n, 3) [m]
        Points of the map.
    path : (k, 3) [m]
        Positions of the sensor in the frame of the map.
    unverified : sequence of int
        Rows of `path` whose motion from the previous row has no status ok; these sections are
        drawn in red.
    title : str
        Title, in red if a motion is not verified.

    Raises
    ------
    MissingExtra
        Matplotlib is not installed.
    InvalidInput
        The map has no points, or the path has no positions.
    """
    if len(points) == 0 or len(path) == 0:
        raise InvalidInput(
            f"a figure of a drive needs points and a path, got {len(points)} points and a path of "
            f"{len(path)} positions"
        )
    figure = blank_figure(8.4, 7.6)
    axes = figure.subplots()
    centre, half = _window(points, path)
    heights = _highest(points, centre, half)
    _shade(figure, axes, heights, centre, half)
    axes.plot(path[:, 0], path[:, 1], color="white", linewidth=3.0)
    axes.plot(path[:, 0], path[:, 1], color=INK, linewidth=1.4)
    for row in unverified:
        section = path[max(row - 1, 0) : row + 1]
        axes.plot(section[:, 0], section[:, 1], color=ALARM, linewidth=2.4, marker="o", ms=4)
    axes.plot(*path[0, :2], color=INK, marker="o", ms=5, mec="white")
    set_map_view(axes, centre, half, ("x [m]", "y [m]"))
    if title:
        axes.set_title(title, fontsize=11, color=ALARM if len(unverified) else INK)
    return figure


def _window(points: Points, path: Points) -> tuple[Vector, float]:
    """Return centre and half side [m] of a square around nearly all points and the path."""
    centre, half = window_around(points[:, :2], path[:, :2])
    farthest = float(np.abs(path[:, :2] - centre).max())
    return centre, max(half, _MARGIN * farthest)


def _highest(points: Points, centre: Vector, half: float) -> Matrix:
    """Return the (rows, columns) maximum heights [m], rows along y; NaN without a point."""
    index = np.floor((points[:, :2] - centre + half) * (_PIXELS / (2.0 * half))).astype(np.int64)
    inside = ((index >= 0) & (index < _PIXELS)).all(axis=1)
    heights = np.full(_PIXELS * _PIXELS, -np.inf)
    np.maximum.at(heights, index[inside, 1] * _PIXELS + index[inside, 0], points[inside, 2])
    heights[np.isneginf(heights)] = np.nan
    return heights.reshape(_PIXELS, _PIXELS)


def _shade(figure: "Figure", axes: "Axes", heights: Matrix, centre: Vector, half: float) -> None:
    finite = heights[np.isfinite(heights)]
    tail = 0.5 * (100.0 - _COLOURED_SHARE)
    low, high = np.percentile(finite, [tail, 100.0 - tail]) if len(finite) else (0.0, 1.0)
    image = axes.imshow(
        heights,
        cmap=_COLOURS,
        origin="lower",
        extent=(centre[0] - half, centre[0] + half, centre[1] - half, centre[1] + half),
        interpolation="nearest",
        vmin=low,
        vmax=high,
    )
    bar = figure.colorbar(image, ax=axes, shrink=0.6, pad=0.015)
    bar.set_label("height in the frame of the first scan [m]", fontsize=8, color=INK)
    bar.ax.tick_params(labelsize=8)
