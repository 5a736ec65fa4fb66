"""Figure of the basin of convergence: solved starts by distance and angle, per method."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from scanlock.errors import InvalidInput
from scanlock.report.canvas import FAINT, INK, blank_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MIN_RATIO_WHITE = 0.55
"""Minimum ratio of cells with white text."""

_COLUMNS = 3


@dataclass(frozen=True, slots=True, eq=False)
class Basin:
    """Solved starts of a method by the error of the start.

    Attributes
    ----------
    solved, tried : (d, a)
        Counts with one row per distance and one column per angle.
    """

    solved: NDArray[np.int64]
    tried: NDArray[np.int64]

    def __post_init__(self) -> None:
        if self.solved.ndim != 2 or self.solved.shape != self.tried.shape:
            raise InvalidInput(
                f"solved and tried must have the same shape (d, a), got {self.solved.shape} and "
                f"{self.tried.shape}"
            )


def basin_figure(
    basins: Mapping[str, Basin], distances_m: Sequence[float], angles_deg: Sequence[float]
) -> "Figure":
    """Return a figure of the ratio of solved starts by the error of the start.

    Parameters
    ----------
    basins : mapping of str to Basin
        Basins by method.
    distances_m, angles_deg : sequence of float [m], [deg]
        Errors of the rows and of the columns.

    Raises
    ------
    MissingExtra
        Matplotlib is not installed.
    InvalidInput
        There is no basin, or a basin has another shape.
    """
    shape = (len(distances_m), len(angles_deg))
    if not basins or any(basin.tried.shape != shape for basin in basins.values()):
        raise InvalidInput(
            f"basins must have shape {shape}, one basin per method, got "
            f"{[basin.tried.shape for basin in basins.values()]}"
        )
    columns = min(len(basins), _COLUMNS)
    rows = -(-len(basins) // columns)
    size = (0.9 + 0.62 * shape[1], 1.0 + 0.46 * shape[0])
    figure = blank_figure(columns * max(size[0], 2.6) + 0.3, rows * size[1] + 0.5)
    figure.suptitle("ratio of solved starts", fontsize=12, color=INK)
    grid = figure.subplots(rows, columns, squeeze=False)
    for axes in grid.flat[len(basins) :]:
        axes.set_axis_off()
    for place, (axes, (name, basin)) in enumerate(zip(grid.flat, basins.items(), strict=False)):
        _draw(axes, basin, distances_m, angles_deg)
        axes.set_title(name, fontsize=10, color=INK)
        if place + columns >= len(basins):
            axes.set_xlabel("initial rotation error [°]", fontsize=8, color=FAINT)
        if place % columns == 0:
            axes.set_ylabel("initial translation error [m]", fontsize=8, color=FAINT)
    return figure


def _draw(
    axes: "Axes", basin: Basin, distances_m: Sequence[float], angles_deg: Sequence[float]
) -> None:
    ratio = np.where(basin.tried > 0, basin.solved / np.maximum(basin.tried, 1), np.nan)
    axes.imshow(ratio, cmap="Blues", vmin=0.0, vmax=1.0, origin="lower", aspect="auto")
    for (row, column), value in np.ndenumerate(ratio):
        text = f"{basin.solved[row, column]}/{basin.tried[row, column]}"
        colour = "white" if value > _MIN_RATIO_WHITE else INK
        axes.text(column, row, text, ha="center", va="center", fontsize=8, color=colour)
    axes.set_xticks(range(len(angles_deg)), [f"{angle:g}" for angle in angles_deg])
    axes.set_yticks(range(len(distances_m)), [f"{metres:g}" for metres in distances_m])
    axes.tick_params(labelsize=8, colors=FAINT, length=0)
    for spine in axes.spines.values():
        spine.set_color("#cccccc")
