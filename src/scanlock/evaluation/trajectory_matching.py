"""Matching of the rows of two trajectories by time, or by the number or name of the scan."""

from collections.abc import Sequence

import numpy as np

from scanlock.arrays import Labels, Vector

MAX_TIME_DIFFERENCE = 0.05
"""Maximum time difference of matching poses [s]; half a sweep at 10 Hz."""

Rows = tuple[Labels, Labels]
"""Matching rows of the first and of the second trajectory."""


def match_times(here: Vector, there: Vector, max_difference: float = MAX_TIME_DIFFERENCE) -> Rows:
    """Return the rows of the closest times, in order of time; each row at most once.

    Parameters
    ----------
    here, there : (n,), (m,) [s]
        Times in any order.
    max_difference : float
        Maximum difference of matching times [s].

    Returns
    -------
    Rows
        Empty where no times are that close.
    """
    order = np.argsort(there, kind="stable")
    after = np.searchsorted(there[order], here).clip(1, max(len(there) - 1, 1))
    sides = np.stack([after - 1, np.minimum(after, len(there) - 1)])
    differences = np.abs(there[order][sides] - here)
    nearest = order[np.take_along_axis(sides, differences.argmin(axis=0)[None], axis=0)[0]]
    difference = differences.min(axis=0)
    # Of several rows with the same match the closest in time is kept.
    rows = np.argsort(difference, kind="stable")
    rows = rows[difference[rows] <= max_difference]
    _, once = np.unique(nearest[rows], return_index=True)
    rows = rows[once]
    rows = rows[np.argsort(here[rows], kind="stable")]
    return rows, nearest[rows]


def match_equal(here: Sequence[object], there: Sequence[object]) -> Rows:
    """Return the rows of equal numbers or names, in the order of the first; each once."""
    row_of = {value: row for row, value in reversed(list(enumerate(there)))}
    rows = {value: row for row, value in reversed(list(enumerate(here))) if value in row_of}
    first = sorted(rows.values())
    second = [row_of[here[row]] for row in first]
    return np.array(first, np.int64), np.array(second, np.int64)
