"""Maps of several methods from above, and one place of them closer, as Figure 4 of Das et al."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from scanlock.arrays import Matrix, Points, Vector, frozen
from scanlock.errors import InvalidInput
from scanlock.report.canvas import (
    FAINT,
    INK,
    VERMILION,
    blank_figure,
    frame,
    richest_square,
    square_view,
    thinned_rows,
    window_around,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLUMNS = 4
_CLOSE_UP = 20.0
"""Side of the place that is shown closer [m]; smaller maps show a quarter of theirs."""

_STATIONS = 50
"""Places of the path that are looked about for the close-up."""

_PIXELS = 440
"""Pixels along the side of a view."""


@dataclass(frozen=True, slots=True, eq=False)
class DrawnMap:
    """A map to look at.

    Attributes
    ----------
    standing : (n, 3) [m]
        Its points, best without those on the ground, which say little and hide the rest.
    path : (k, 3) [m]
        Where the sensor was.
    caption : str
        What to say of it below its name.
    """

    standing: Points
    path: Points
    caption: str = ""

    def __post_init__(self) -> None:
        frozen(self.standing)
        frozen(self.path)


def map_figure(maps: Mapping[str, DrawnMap], *, title: str = "") -> "Figure":
    """Return a figure of maps in one frame: whole with the path, and closer inside the frame.

    Each pixel is the darker the more points fall into it, so that what is smeared is pale. All
    maps share a window that holds nearly all of every one, however far some have strayed, and the
    place of the close-up, which is chosen on the first.

    Raises
    ------
    MissingExtra
        Matplotlib is not installed.
    InvalidInput
        No map, or one without points.
    """
    if not maps or any(len(drawn.standing) == 0 for drawn in maps.values()):
        raise InvalidInput("a map figure needs maps with points in them")
    first = next(iter(maps.values()))
    own_middle, own_half = window_around(first.standing[:, :2], first.path[:, :2])
    side = min(_CLOSE_UP, 0.5 * own_half)
    corner = _place_by_the_path(first, own_middle, own_half, side)
    middle, half = _common_window([*maps.values()])
    blocks = -(-len(maps) // _COLUMNS)
    columns = -(-len(maps) // blocks)
    figure = blank_figure(3.3 * columns + 0.5, blocks * 7.0 + 0.3 * bool(title))
    if title:
        figure.suptitle(title, fontsize=12, color=INK)
    grid = figure.subplots(2 * blocks, columns, squeeze=False)
    for axes in grid.flat:
        axes.set_axis_off()
    for place, (name, drawn) in enumerate(maps.items()):
        block, column = divmod(place, columns)
        whole, close = grid[2 * block, column], grid[2 * block + 1, column]
        for axes in (whole, close):
            axes.set_axis_on()
        _shade(whole, drawn.standing, middle, half)
        whole.plot(drawn.path[:, 0], drawn.path[:, 1], color=VERMILION, linewidth=0.9)
        square_view(whole, middle, half, ("", "y [m]" if column == 0 else ""))
        whole.set_title(_title(name, drawn), fontsize=10, color=INK)
        frame(whole, corner, side)
        _shade(close, drawn.standing, corner + 0.5 * side, 0.5 * side)
        square_view(close, corner + 0.5 * side, 0.5 * side, ("x [m]", "y [m]" * (column == 0)))
        close.set_title("inside the frame", fontsize=9, color=FAINT)
    return figure


def _common_window(maps: Sequence[DrawnMap]) -> tuple[Vector, float]:
    """Return the middle and half the side [m] of a square around the windows of all maps."""
    windows = [window_around(drawn.standing[:, :2], drawn.path[:, :2]) for drawn in maps]
    low = np.min([middle - half for middle, half in windows], axis=0)
    high = np.max([middle + half for middle, half in windows], axis=0)
    return 0.5 * (low + high), 0.5 * float((high - low).max())


def _place_by_the_path(drawn: DrawnMap, middle: Vector, half: float, side: float) -> Vector:
    """Return the corner of the close-up: near the path, where several scans see the same."""
    stations = drawn.path[:: max(1, len(drawn.path) // _STATIONS), :2]
    points = drawn.standing[thinned_rows(len(drawn.standing))]
    gaps = np.abs(points[:, None, :2] - stations[None]).max(axis=2).min(axis=1)
    return richest_square([points[gaps < side]], middle, half, side)


def _shade(axes: "Axes", points: Points, middle: Vector, half: float) -> None:
    limits = [(middle[axis] - half, middle[axis] + half) for axis in (0, 1)]
    counts, _, _ = np.histogram2d(points[:, 0], points[:, 1], bins=_PIXELS, range=limits)
    axes.imshow(
        np.log1p(_capped(counts)).T,
        cmap="Greys",
        origin="lower",
        extent=(*limits[0], *limits[1]),
        interpolation="nearest",
        vmin=0.0,
    )


def _capped(counts: Matrix) -> Matrix:
    # A few pixels under the sensor's nose hold thousands of points and would pale all others.
    filled = counts[counts > 0.0]
    return np.minimum(counts, np.percentile(filled, 98.0)) if len(filled) else counts


def _title(name: str, drawn: DrawnMap) -> str:
    return f"{name}\n{drawn.caption}" if drawn.caption else name
