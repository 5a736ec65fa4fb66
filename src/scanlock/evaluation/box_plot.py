"""Numbers summed up as a box plot draws them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from scanlock.arrays import Vector, frozen
from scanlock.errors import InvalidInput, require_positive


@dataclass(frozen=True, slots=True, eq=False)
class BoxPlot:
    """A box and its whiskers.

    Attributes
    ----------
    count : int
        How many finite values there are.
    low, lower, median, upper, high : float
        Lower whisker, quartiles, upper whisker. Whiskers end at the last value inside their reach.
    outliers : (n,)
        What lies beyond the whiskers, ascending.
    """

    count: int
    low: float
    lower: float
    median: float
    upper: float
    high: float
    outliers: Vector

    def __post_init__(self) -> None:
        frozen(self.outliers)


def spread(values: ArrayLike, reach: float = 1.5) -> BoxPlot:
    """Return the spread of values; those that are not finite are left out.

    Parameters
    ----------
    values : (n,)
    reach : float
        Length of the whiskers over the distance of the quartiles: 1.5 in Das et al. 2013.

    Raises
    ------
    InvalidInput
        No finite value.
    """
    require_positive("reach", reach)
    given = np.asarray(values, np.float64).ravel()
    kept = np.sort(given[np.isfinite(given)])
    if len(kept) == 0:
        raise InvalidInput(f"values must hold a finite number, got {len(given)} others")
    lower, median, upper = (float(q) for q in np.percentile(kept, (25.0, 50.0, 75.0)))
    length = reach * (upper - lower)
    is_inside = (kept >= lower - length) & (kept <= upper + length)
    inside = kept[is_inside]
    return BoxPlot(
        len(kept), float(inside[0]), lower, median, upper, float(inside[-1]), kept[~is_inside]
    )
