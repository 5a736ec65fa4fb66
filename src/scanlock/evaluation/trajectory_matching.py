"""Matching of the rows of two trajectories by time or by the number of the scan."""

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


def match_numbers(here: Labels, there: Labels) -> Rows:
    """Return the rows of equal scan numbers, in order of the number; each number once."""
    _, first, second = np.intersect1d(here, there, return_indices=True)
    return first.astype(np.int64), second.astype(np.int64)
