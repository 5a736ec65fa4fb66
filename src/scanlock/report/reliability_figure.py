"""What a probability said, and how often it was so."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from scanlock.arrays import Mask, Vector
from scanlock.errors import InvalidInput
from scanlock.report.canvas import CATEGORIES, FAINT, INK, blank_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def reliability_figure(said: Vector, right: Mask, edges: Sequence[float]) -> "Figure":
    """Return a figure with how often what was said came true, by bins of what was said.

    Parameters
    ----------
    said : (n,)
        Probabilities, in [0, 1].
    right : (n,)
        Whether it was so.
    edges : sequence of float
        Of the bins, ascending. Bars are intervals of 95 % after Wilson (1927).

    Raises
    ------
    MissingExtra
        Matplotlib is not installed.
    InvalidInput
        Nothing was said, or the two differ in length.
    """
    if len(said) == 0 or len(said) != len(right):
        raise InvalidInput(f"said and right must be as long, got {len(said)} and {len(right)}")
    figure = blank_figure(9.0, 4.2)
    curve, counts = figure.subplots(1, 2)
    bins = np.digitize(said, edges[1:-1])
    used = np.unique(bins)
    means = np.array([said[bins == one].mean() for one in used])
    shares = np.array([right[bins == one].mean() for one in used])
    sizes = np.array([(bins == one).sum() for one in used])
    low, high = _wilson(shares, sizes)
    curve.plot([0.0, 1.0], [0.0, 1.0], color=FAINT, linewidth=1.0, label="as said")
    curve.errorbar(
        means, shares, yerr=np.maximum(0.0, [shares - low, high - shares]), fmt="o",
        color=CATEGORIES[0], markersize=5, label="poses, with 95 %",
    )  # fmt: skip
    curve.set_xlabel("probability said", color=FAINT)
    curve.set_ylabel("share that is right", color=FAINT)
    curve.legend(fontsize=8, labelcolor=INK, loc="upper left")
    both = [said[right], said[~right]]
    counts.hist(
        both, bins=np.linspace(0.0, 1.0, 41).tolist(), stacked=True,
        color=[CATEGORIES[0], CATEGORIES[1]], label=["right", "wrong"],
    )  # fmt: skip
    counts.set_yscale("log")
    counts.set_xlabel("probability said", color=FAINT)
    counts.set_ylabel("poses", color=FAINT)
    counts.legend(fontsize=8, labelcolor=INK, loc="upper center")
    return figure


def _wilson(shares: Vector, sizes: Vector) -> tuple[Vector, Vector]:
    """Return the ends of the intervals that hold the true shares with 95 %."""
    square = 1.96**2 / sizes
    middle = (shares + 0.5 * square) / (1.0 + square)
    half = np.sqrt(square * (shares * (1.0 - shares) + 0.25 * square)) / (1.0 + square)
    return middle - half, middle + half
