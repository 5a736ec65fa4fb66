"""Figure of maps from above, each with a close-up, as Figure 4 of Das et al. 2013."""

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
    close_up_corner,
    downsampled_rows,
    draw_frame,
    set_map_view,
    window_around,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLUMNS = 4
_CLOSE_UP = 20.0
"""Side of the close-up [m]; a quarter of the side for smaller maps."""

_POSITIONS = 50
"""Number of path positions around which the close-up is searched."""

_PIXELS = 440
"""Number of pixels along a side of a view."""


@dataclass(frozen=True, slots=True, eq=False)
class DrawnMap:
    """Points and path of a map.

    Attributes
    ----------
    points : (n, 3) [m]
        Points of the map, preferably above the ground, which would cover them.
    path : (k, 3) [m]
        Positions of the sensor.
    caption : str
        Line below the name of the map.
    """

    points: Points
    path: Points
    caption: str = ""

    def __post_init__(self) -> None:
        frozen(self.points)
        frozen(self.path)


def map_figure(maps: Mapping[str, DrawnMap], *, title: str = "") -> "Figure":
    """Return a figure of maps: the whole map with the path, and a close-up.

    Pixels with more points are darker, so blurred surfaces are pale. All maps share one window
    around nearly all points of all maps, and one close-up, which is chosen on the first map.

    Raises
    ------
    MissingExtra
        Matplotlib is not installed.
    InvalidInput
        There is no map, or a map has no points.
    """
    if not maps or any(len(drawn.points) == 0 for drawn in maps.values()):
        raise InvalidInput("a map figure needs at least one map, and points in each")
    first = next(iter(maps.values()))
    own_centre, own_half = window_around(first.points[:, :2], first.path[:, :2])
    side = min(_CLOSE_UP, 0.5 * own_half)
    corner = _close_up_near_path(first, own_centre, own_half, side)
    centre, half = _common_window([*maps.values()])
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
        _shade(whole, drawn.points, centre, half)
        whole.plot(drawn.path[:, 0], drawn.path[:, 1], color=VERMILION, linewidth=0.9)
        set_map_view(whole, centre, half, ("", "y [m]" if column == 0 else ""))
        whole.set_title(_title(name, drawn), fontsize=10, color=INK)
        draw_frame(whole, corner, side)
        _shade(close, drawn.points, corner + 0.5 * side, 0.5 * side)
        set_map_view(close, corner + 0.5 * side, 0.5 * side, ("x [m]", "y [m]" * (column == 0)))
        close.set_title("inside the frame", fontsize=9, color=FAINT)
    return figure


def _common_window(maps: Sequence[DrawnMap]) -> tuple[Vector, float]:
    """Return centre and half side [m] of a square around the windows of all maps."""
    windows = [window_around(drawn.points[:, :2], drawn.path[:, :2]) for drawn in maps]
    low = np.min([centre - half for centre, half in windows], axis=0)
    high = np.max([centre + half for centre, half in windows], axis=0)
    return 0.5 * (low + high), 0.5 * float((high - low).max())


def _close_up_near_path(drawn: DrawnMap, centre: Vector, half: float, side: float) -> Vector:
    """Return the corner of the close-up, near the path, where scans overlap."""
    positions = drawn.path[:: max(1, len(drawn.path) // _POSITIONS), :2]
    points = drawn.points[downsampled_rows(len(drawn.points))]
    distances = np.abs(points[:, None, :2] - positions[None]).max(axis=2).min(axis=1)
    return close_up_corner([points[distances < side]], centre, half, side)


def _shade(axes: "Axes", points: Points, centre: Vector, half: float) -> None:
    limits = [(centre[axis] - half, centre[axis] + half) for axis in (0, 1)]
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
    # A few pixels near the sensor hold thousands of points and would make all others pale.
    filled = counts[counts > 0.0]
    return np.minimum(counts, np.percentile(filled, 98.0)) if len(filled) else counts


def _title(name: str, drawn: DrawnMap) -> str:
    return f"{name}\n{drawn.caption}" if drawn.caption else name
