"""Reliability diagram: predicted probabilities against observed frequencies."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from scanlock.arrays import Mask, Vector
from scanlock.errors import InvalidInput
from scanlock.report.canvas import CATEGORIES, FAINT, INK, blank_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def reliability_figure(probabilities: Vector, outcomes: Mask, edges: Sequence[float]) -> "Figure":
    """Return a figure of the observed frequency by bins of the predicted probability.

    Parameters
    ----------
    probabilities : (n,)
        Predicted probabilities, in [0, 1].
    outcomes : (n,)
        Whether the predicted events occurred.
    edges : sequence of float
        Ascending edges of the bins.

    Raises
    ------
    MissingExtra
        Matplotlib is not installed.
    InvalidInput
        The arrays are empty or differ in length.

    Notes
    -----
    Error bars are 95 % intervals after Wilson (1927).
    """
    if len(probabilities) == 0 or len(probabilities) != len(outcomes):
        raise InvalidInput(
            "probabilities and outcomes must have the same length, at least 1, got "
            f"{len(probabilities)} and {len(outcomes)}"
        )
    figure = blank_figure(9.0, 4.2)
    curve, counts = figure.subplots(1, 2)
    bins = np.digitize(probabilities, edges[1:-1])
    used = np.unique(bins)
    means = np.array([probabilities[bins == one].mean() for one in used])
    ratios = np.array([outcomes[bins == one].mean() for one in used])
    sizes = np.array([(bins == one).sum() for one in used])
    low, high = _wilson(ratios, sizes)
    curve.plot([0.0, 1.0], [0.0, 1.0], color=FAINT, linewidth=1.0, label="perfect calibration")
    curve.errorbar(
        means, ratios, yerr=np.maximum(0.0, [ratios - low, high - ratios]), fmt="o",
        color=CATEGORIES[0], markersize=5, label="poses with 95 % intervals",
    )  # fmt: skip
    curve.set_xlabel("predicted probability", color=FAINT)
    curve.set_ylabel("ratio of correct poses", color=FAINT)
    curve.legend(fontsize=8, labelcolor=INK, loc="upper left")
    both = [probabilities[outcomes], probabilities[~outcomes]]
    counts.hist(
        both, bins=np.linspace(0.0, 1.0, 41).tolist(), stacked=True,
        color=[CATEGORIES[0], CATEGORIES[1]], label=["correct", "wrong"],
    )  # fmt: skip
    counts.set_yscale("log")
    counts.set_xlabel("predicted probability", color=FAINT)
    counts.set_ylabel("poses", color=FAINT)
    counts.legend(fontsize=8, labelcolor=INK, loc="upper center")
    return figure


def _wilson(ratios: Vector, sizes: Vector) -> tuple[Vector, Vector]:
    """Return the ends of the 95 % intervals of the true ratios."""
    square = 1.96**2 / sizes
    centre = (ratios + 0.5 * square) / (1.0 + square)
    half = np.sqrt(square * (ratios * (1.0 - ratios) + 0.25 * square)) / (1.0 + square)
    return centre - half, centre + half
