"""Length and names of the rows of headerless float32 values, guessed from the values.

With a wrong row length, every column mixes several quantities, so that all columns have similar
distributions. With the correct one they differ. The test does not depend on the order of the rows.
"""

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scanlock.io.columns import conventional_names
from scanlock.io.errors import malformed

_COMMON_WIDTHS = (3, 4, 5)
"""Row lengths that are assumed where the values do not decide: xyz, KITTI, nuScenes."""

_WIDTHS = (3, 4, 5, 6, 7, 8)
"""Row lengths that are compared."""

_MAX_NAMED = 6
"""Maximum row length of which the columns can be named without being asked for."""

_SAMPLE_ROWS = 2048

_MIN_DISTANCE = 0.2
"""Distance of the distributions of two columns above which they are different quantities.

Real scans have 0.26 to 1.0 with the correct row length, and below 0.06 with a wrong one that has
no common factor with it (0.15 for 300 rows).
"""

_SIMILAR_DISTANCE = 0.05
"""Difference of two distances that sampling causes."""

_MIN_ROWS = 8
"""Minimum number of rows for a guess from whole numbers."""

_MAX_COLOUR, _MAX_RING = 255, 511

_REMEDY = "pass columns= (number or names) if it is known, or copy the file again"

Values = NDArray[np.float32]


def guess_row_length(path: Path, values: Values) -> tuple[int, str]:
    """Guess the number of columns.

    Parameters
    ----------
    path : Path
        The file, for messages.
    values : (n,)

    Returns
    -------
    width : int
    note : str
        Reason for the guess.

    Raises
    ------
    FormatError
        The values suggest a row length that does not divide their number, or no common row length
        does.
    """
    fitting = [width for width in _COMMON_WIDTHS if len(values) % width == 0]
    likely = _width_by_distributions(values) or _width_by_whole_numbers(values)
    if likely is not None and len(values) % likely:
        raise malformed(
            path,
            f"byte {4 * (len(values) - len(values) % likely)}",
            expected=f"whole rows of {likely} float32, as the values suggest",
            found=f"{4 * (len(values) % likely)} bytes left over",
            remedy=f"the file is cut short; {_REMEDY}",
        )
    if likely is not None and fitting != [likely]:
        others = ", ".join(map(str, sorted({*fitting, likely})))
        return likely, (
            f"{likely} float32 columns guessed from the values ({others} fit the size); columns= "
            "overrides"
        )
    if not fitting:
        raise malformed(
            path,
            f"byte {4 * len(values)}",
            expected="whole rows of 3, 4 or 5 float32",
            found=f"the end after {len(values)} values",
            remedy=_REMEDY,
        )
    if len(fitting) == 1:
        return fitting[0], (
            f"{fitting[0]} float32 columns assumed: the only common number that fits the size"
        )
    # The only criterion left is that an intensity is never negative.
    width = 4 if 4 in fitting and not (3 in fitting and (values[3::4] < 0).any()) else fitting[0]
    others = ", ".join(str(other) for other in fitting if other != width)
    return width, (
        f"{width} float32 columns assumed: the size also fits {others}, and the values do not "
        "decide; columns= overrides"
    )


def names_of_columns(path: Path, table: Values) -> tuple[str, ...]:
    """Return names for columns: those of KITTI and nuScenes, of colours or of normals.

    Parameters
    ----------
    path : Path
        The file, for messages.
    table : (n, 3+)

    Raises
    ------
    FormatError
        Columns after the third of which the meaning is unknown.
    """
    width = table.shape[1]
    if width == 5 and not _is_whole(table[:, 4], _MAX_RING):
        return (*conventional_names(4), "column_5")
    if width <= 5:
        return conventional_names(width)
    if width == _MAX_NAMED:
        more = table[:, 3:]
        if _is_whole(more, _MAX_COLOUR) or (more.min() >= 0 and more.max() <= 1):
            return ("x", "y", "z", "red", "green", "blue")
        if np.abs(np.linalg.norm(more, axis=1) - 1.0).max() < 0.01:
            return ("x", "y", "z", "nx", "ny", "nz")
    raise malformed(
        path,
        "data",
        expected="rows of x, y, z and an intensity, an intensity and a ring, colours or normals",
        found=f"rows of {width} float32, as the values suggest",
        remedy=f"name every column with columns=, as in "
        f'"x y z {" ".join(f"column_{k + 1}" for k in range(3, width))}"',
    )


def _width_by_distributions(values: Values) -> int | None:
    """Return the row length that the distributions indicate clearly; None if they do not."""
    distances = {
        width: _column_distance(values, width) for width in _WIDTHS if len(values) >= width
    }
    if not distances:
        return None
    # Multiples of a row length have its distances, so the shortest is taken first.
    lowest = max(distances.values()) - max(
        _SIMILAR_DISTANCE, 0.5 * _chance_distance(values, max(_WIDTHS))
    )
    best = min(one for one in distances if distances[one] >= lowest)
    # With a common factor, a wrong length keeps a part of the differences.
    independent = (distances[one] for one in distances if math.gcd(one, best) == 1)
    required = max(_MIN_DISTANCE, 2.0 * max(independent, default=0.0))
    if distances[best] <= max(required, _chance_distance(values, best)):
        return None
    double = 2 * best
    is_double = double in distances and _half_distance(values, double) > max(
        _MIN_DISTANCE, _chance_distance(values, double)
    )
    return double if is_double else best


def _width_by_whole_numbers(values: Values) -> int | None:
    """Return the row length at which only the columns of a ring or of colours are whole."""
    found: list[int] = []
    for width, first, largest in ((4, 3, _MAX_RING), (5, 4, _MAX_RING), (6, 3, _MAX_COLOUR)):
        if len(values) % width or len(values) < _MIN_ROWS * width:
            continue
        table = values.reshape(-1, width)
        others = table[:, :first]
        if _is_whole(table[:, first:], largest) and (others != np.round(others)).any(axis=0).all():
            found.append(width)
    return found[0] if len(found) == 1 else None


def _is_whole(part: Values, largest: int) -> bool:
    return bool((part == np.round(part)).all() and part.min() >= 0 and part.max() <= largest)


def _row_stride(rows: int) -> int:
    stride = max(1, rows // _SAMPLE_ROWS)
    # With a stride that has a common factor with a row length, the columns of wrong rows would
    # differ in distribution too.
    while math.gcd(stride, math.prod(_WIDTHS)) != 1:
        stride += 1
    return stride


def _chance_distance(values: Values, width: int) -> float:
    """Return the distance that two samples of one distribution exceed in 0.1 % of cases."""
    rows = max(1, len(values) // width)
    return 1.95 * math.sqrt(2.0 / -(-rows // _row_stride(rows)))


def _cumulative_counts(values: Values, width: int) -> tuple[NDArray[np.int32], int]:
    """Return the cumulative counts (width, k) of each column at all values, and the sample size."""
    rows = len(values) // width
    table = values[: rows * width].reshape(rows, width)[:: _row_stride(rows)]
    pooled = np.where(np.isfinite(table), table, 0.0).ravel()
    order = np.argsort(pooled)
    columns = np.arange(width, dtype=np.int32)
    owners = np.tile(columns, len(table))[order]
    counts = np.cumsum(owners == columns[:, None], axis=1, dtype=np.int32)
    ascending = pooled[order]
    is_last = np.append(ascending[1:] != ascending[:-1], True)
    return counts[:, is_last], len(table)


def _column_distance(values: Values, width: int) -> float:
    """Return the largest Kolmogorov-Smirnov distance of two columns, for a row length."""
    counts, size = _cumulative_counts(values, width)
    return float((counts.max(axis=0) - counts.min(axis=0)).max()) / size


def _half_distance(values: Values, width: int) -> float:
    """Return the largest distance between a column and that of half a row later."""
    counts, size = _cumulative_counts(values, width)
    half = width // 2
    return float(np.abs(counts[:half] - counts[half:]).max()) / size
