"""Box-plot statistics of a sample."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from scanlock.arrays import Vector, frozen
from scanlock.errors import InvalidInput, require_positive


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class BoxPlot:
    """Quartiles, whiskers and outliers of a sample, in the unit of its values.

    Attributes
    ----------
    count : int
        Number of finite values.
    lower_whisker, upper_whisker : float
        Smallest and largest value that is no outlier.
    lower_quartile, median, upper_quartile : float
    outliers : (n,)
        Values beyond the whiskers, ascending.
    """

    count: int
    lower_whisker: float
    lower_quartile: float
    median: float
    upper_quartile: float
    upper_whisker: float
    outliers: Vector

    def __post_init__(self) -> None:
        frozen(self.outliers)


def box_plot(values: ArrayLike, max_whisker: float = 1.5) -> BoxPlot:
    """Compute the box-plot statistics of values; NaN and Inf are left out.

    Parameters
    ----------
    values : (n,)
    max_whisker : float
        Maximum length of the whiskers in interquartile ranges; 1.5 in Das et al. 2013.

    Raises
    ------
    InvalidInput
        No finite value, or a `max_whisker` that is not positive.
    """
    require_positive("max_whisker", max_whisker)
    given = np.asarray(values, np.float64).ravel()
    finite = np.sort(given[np.isfinite(given)])
    if len(finite) == 0:
        raise InvalidInput(f"values must hold a finite number, got {len(given)} NaN or Inf")
    lower, median, upper = (float(q) for q in np.percentile(finite, (25.0, 50.0, 75.0)))
    length = max_whisker * (upper - lower)
    is_inside = (finite >= lower - length) & (finite <= upper + length)
    inside = finite[is_inside]
    return BoxPlot(
        count=len(finite),
        lower_whisker=float(inside[0]),
        lower_quartile=lower,
        median=median,
        upper_quartile=upper,
        upper_whisker=float(inside[-1]),
        outliers=finite[~is_inside],
    )
