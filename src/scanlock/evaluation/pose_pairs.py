"""Pairs of poses of a trajectory that lie a number of scans, metres or seconds apart."""

from typing import Literal

import numpy as np

from scanlock.arrays import Labels, Vector
from scanlock.errors import InvalidInput, require_positive

DeltaUnit = Literal["scans", "m", "s"]
"""Unit of the distance between the two poses of a pair: rows, path length or time."""

Pairs = tuple[Labels, Labels]
"""First and last row of each pair."""

_TOLERANCE = 0.1
"""Largest deviation from the distance of a pair, relative to it; that of evo."""

_UNIT_NAMES = {"scans": "scans", "m": "path length", "s": "time"}


def pose_pairs(
    steps: Vector, delta: float, unit: DeltaUnit = "scans", *, all_pairs: bool = False
) -> Pairs:
    """Return the pairs of rows that lie `delta` apart.

    Parameters
    ----------
    steps : (n - 1,)
        Path length [m] or time [s] between consecutive rows; ones for scans.
    delta : float
        Distance of the two poses in the unit of `steps`.
    unit : {"scans", "m", "s"}
        For messages, and whole numbers of scans.
    all_pairs : bool
        Start a pair at each row, and accept a distance within 10 % of `delta`. By default each
        pair starts where the previous one ends, at the first row at least `delta` farther.

    Returns
    -------
    first, last : (k,)
        Rows of the poses of each pair; the pairs of evo with ``--pairs_from_reference``.

    Raises
    ------
    InvalidInput
        No such pair, or a `delta` that is not positive, or not a whole number of scans.
    """
    name = f"delta [{unit}]"
    require_positive(name, delta)
    if unit == "scans" and not float(delta).is_integer():
        raise InvalidInput(f"{name} must be a whole number, got {delta:g}")
    tolerance = 0.0 if unit == "scans" else _TOLERANCE * delta
    pairs = _every_pair(steps, delta, tolerance) if all_pairs else _chained_pairs(steps, delta)
    first, last = pairs
    if len(first) == 0:
        total = float(steps.sum())
        raise InvalidInput(
            f"{name} must be below the {_UNIT_NAMES[unit]} of the trajectory, {total:g}, got "
            f"{delta:g}; use less, or another unit"
        )
    return first, last


def _chained_pairs(steps: Vector, delta: float) -> Pairs:
    rows = [0]
    passed = 0.0
    for row, step in enumerate(steps.tolist(), start=1):
        passed += step
        if passed >= delta:
            rows.append(row)
            passed = 0.0
    ends = np.array(rows, np.int64)
    return ends[:-1], ends[1:]


def _every_pair(steps: Vector, delta: float, tolerance: float) -> Pairs:
    along = np.concatenate([[0.0], np.cumsum(steps)])
    first: list[int] = []
    last: list[int] = []
    for row in range(len(steps)):
        away = np.abs(along[row + 1 :] - along[row] - delta)
        nearest = int(away.argmin())
        if away[nearest] <= tolerance:
            first.append(row)
            last.append(row + 1 + nearest)
    return np.array(first, np.int64), np.array(last, np.int64)
