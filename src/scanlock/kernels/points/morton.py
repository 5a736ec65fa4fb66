"""Morton codes (Z-order): sorting by them keeps neighbours in space together."""

import numpy as np

from scanlock.arrays import Labels, Points
from scanlock.kernels._compile import helper, kernel

_CELLS = 1023.0
"""Cells along a side of the bounding cube, for ten bits per axis."""


@helper
def _interleaved(bits: int) -> int:
    """Return ten bits with two zero bits after each."""
    bits = (bits | (bits << 16)) & 0x30000FF
    bits = (bits | (bits << 8)) & 0x300F00F
    bits = (bits | (bits << 4)) & 0x30C30C3
    return (bits | (bits << 2)) & 0x9249249


@kernel
def morton_codes(points: Points) -> Labels:
    """Return the (n,) Morton codes of (n, 3) points, ten bits per axis."""
    codes = np.empty(points.shape[0], np.int64)
    if points.shape[0] == 0:
        return codes
    low = np.array([points[:, 0].min(), points[:, 1].min(), points[:, 2].min()])
    high = np.array([points[:, 0].max(), points[:, 1].max(), points[:, 2].max()])
    scale = _CELLS / max((high - low).max(), 1e-9)
    for i in range(points.shape[0]):
        x = int((points[i, 0] - low[0]) * scale)
        y = int((points[i, 1] - low[1]) * scale)
        z = int((points[i, 2] - low[2]) * scale)
        codes[i] = _interleaved(x) | (_interleaved(y) << 1) | (_interleaved(z) << 2)
    return codes
