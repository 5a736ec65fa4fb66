"""Scales and offsets of coordinates that LAS stores as 32-bit integers."""

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Points, Vector

_FINE = 1e-4
"""Step of coordinates that are not multiples of the step of their file [m]."""

_MIN_INTEGER, _MAX_INTEGER = -(2**31), 2**31 - 1

_ROUNDING = 8.0 * float(np.finfo(np.float64).eps)
"""Relative rounding of coordinates that were scaled, shifted and converted to metres and back."""


def coordinate_grid(
    coordinates: Points, scales: Vector, offsets: Vector, metres: Vector
) -> tuple[Vector, Vector]:
    """Choose scales and offsets for coordinates.

    The given ones are kept if all coordinates are multiples of them, as in a file that was read.
    Moved points get finer scales: those of the file divided by powers of ten until they are 0.1 mm
    or less. If 32 bits cannot hold such steps about an offset at the points, the finest steps that
    fit are used.

    Parameters
    ----------
    coordinates : (n, 3)
    scales, offsets : (3,)
        Those of the file.
    metres : (3,) [m]
        Size of the unit of x, y and z.

    Returns
    -------
    scales, offsets : (3,)
    """
    chosen = np.empty((2, 3))
    for axis in range(3):
        chosen[:, axis] = _axis_grid(
            coordinates[:, axis], float(scales[axis]), float(offsets[axis]), float(metres[axis])
        )
    return chosen[0], chosen[1]


def on_grid(coordinates: Points, scales: Vector, offsets: Vector) -> NDArray[np.int32]:
    """Return the (n, 3) integers that LAS stores for coordinates."""
    return np.round((coordinates - offsets) / scales).astype(np.int32)


def _axis_grid(values: Vector, scale: float, offset: float, metres: float) -> tuple[float, float]:
    if not (0.0 < scale < np.inf and np.isfinite(offset)):
        scale, offset = _FINE, 0.0
    steps = (values - offset) / scale
    magnitude = max(float(np.abs(values).max()), abs(offset)) / scale
    if _fit(steps) and _are_whole(steps, _ROUNDING * magnitude):
        return scale, offset
    low, high = float(values.min()), float(values.max())
    while scale * metres > _FINE * (1.0 + 1e-9):
        scale /= 10.0
    # A unit is left for the offset, which is rounded.
    while (high - low + 1.0) / scale >= _MAX_INTEGER:
        scale *= 10.0
    if not _fit((np.array([low, high]) - offset) / scale):
        offset = float(np.floor(low))
    return scale, offset


def _fit(steps: Vector) -> bool:
    whole = np.round(steps)
    return bool(whole.min() >= _MIN_INTEGER and whole.max() <= _MAX_INTEGER)


def _are_whole(steps: Vector, rounding: float) -> bool:
    return bool((np.abs(steps - np.round(steps)) <= rounding).all())
