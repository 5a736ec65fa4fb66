"""View of a scan from above, and the motions at which two scans correlate with themselves."""

import math

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Matrix
from scanlock.kernels._compile import helper, kernel


@kernel
def view_from_above(
    columns: NDArray[np.uint64], half: int, merged: int, max_bins: int
) -> NDArray[np.float32]:
    """Return the numbers of occupied height bins of the columns around the axis, seen from above.

    The 2 `half` columns along each side around the axis are merged in squares of `merged` by
    `merged`. Numbers above `max_bins` count as `max_bins`.
    """
    first = columns.shape[0] // 2 - half
    side = 2 * half // merged
    view = np.empty((side, side), np.float32)
    for i in range(side):
        for j in range(side):
            bins = np.uint64(0)
            for k in range(first + i * merged, first + (i + 1) * merged):
                for m in range(first + j * merged, first + (j + 1) * merged):
                    bins |= columns[k, m]
            count = 0
            while bins != np.uint64(0) and count < max_bins:
                bins &= bins - np.uint64(1)
                count += 1
            view[i, j] = count
    return view


@helper
def _between(values: Matrix, x: float, y: float) -> float:
    """Return the bilinear interpolation of a square array at a fractional row and column.

    0 outside of the array.
    """
    side = values.shape[0]
    i, j = math.floor(x), math.floor(y)
    if i < 0 or j < 0 or i >= side - 1 or j >= side - 1:
        return 0.0
    u, v = x - i, y - j
    low = (1.0 - v) * values[i, j] + v * values[i, j + 1]
    high = (1.0 - v) * values[i + 1, j] + v * values[i + 1, j + 1]
    return (1.0 - u) * low + u * high


@kernel
def common_correlation(
    target: Matrix, source: Matrix, cosine: float, sine: float, x0: float, y0: float
) -> Matrix:
    """Return the smaller of two correlations at each translation along the target's axes.

    Parameters
    ----------
    target, source : (s, s)
        Correlations; the middle cell is no translation.
    cosine, sine : float
        Of the heading of the source in the target.
    x0, y0 : float [cells]
        Translation of the target for which that of the source is zero, with the opposite sign.
    """
    side = target.shape[0]
    steps = side // 2
    common = np.zeros((side, side))
    for i in range(side):
        for j in range(side):
            x, y = i - steps + x0, j - steps + y0
            turned = _between(source, cosine * x + sine * y + steps, cosine * y - sine * x + steps)
            common[i, j] = min(target[i, j], turned)
    return common


@kernel
def peaks_above(values: Matrix, low: float, radius: int) -> Matrix:
    """Return row, column and value of the largest values within a square, where above `low`.

    `radius` is the half side of the square. Equal values are all returned.
    """
    side = values.shape[0]
    peaks = np.empty((side * side, 3))
    count = 0
    for i in range(side):
        for j in range(side):
            value = values[i, j]
            if value <= low:
                continue
            is_peak = True
            for k in range(max(0, i - radius), min(side, i + radius + 1)):
                for m in range(max(0, j - radius), min(side, j + radius + 1)):
                    is_peak = is_peak and values[k, m] <= value
            if is_peak:
                peaks[count, 0], peaks[count, 1], peaks[count, 2] = i, j, value
                count += 1
    return peaks[:count].copy()
