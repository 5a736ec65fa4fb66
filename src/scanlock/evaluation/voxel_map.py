"""A map that keeps one point in each voxel, however many scans are laid into it."""

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Labels, Points
from scanlock.errors import InvalidInput, require_positive

_HALF = 1 << 20
"""Voxels on either side of zero along each axis: three indices fit into 64 bits."""


class VoxelMap:
    """The first point of each occupied voxel; their number is the crispness of the map.

    Parameters
    ----------
    width : float [m]
        Side of the voxels, which have a corner at zero.
    """

    def __init__(self, width: float) -> None:
        require_positive("width", width, unit="m")
        self._width = width
        self._keys: Labels = np.zeros(0, np.int64)
        self._points: NDArray[np.float32] = np.zeros((0, 3), np.float32)
        self._pending: list[tuple[Labels, NDArray[np.float32]]] = []
        self._pending_count = 0

    def add(self, points: Points) -> None:
        """Lay (n, 3) points into the map.

        Raises
        ------
        InvalidInput
            Points of another shape, not finite, or farther than a million voxels from zero.
        """
        if points.ndim != 2 or points.shape[1] != 3:
            raise InvalidInput(f"points must have shape (n, 3), got {points.shape}")
        index = np.floor(points / self._width)
        if not (np.abs(index) < _HALF).all():
            raise InvalidInput(
                f"points must be finite and within {_HALF * self._width:g} m of zero; take the "
                "map's origin off them"
            )
        shifted = index.astype(np.int64) + _HALF
        keys = (shifted[:, 0] << 42) | (shifted[:, 1] << 21) | shifted[:, 2]
        keys, first = np.unique(keys, return_index=True)
        self._pending.append((keys, points[first].astype(np.float32)))
        self._pending_count += len(keys)
        # Merging only once as much is waiting as is there already costs n log n over all.
        if self._pending_count > len(self._keys):
            self._merge()

    def __len__(self) -> int:
        self._merge()
        return len(self._keys)

    @property
    def points(self) -> NDArray[np.float32]:
        """The (n, 3) kept points [m], by voxel."""
        self._merge()
        return self._points

    def _merge(self) -> None:
        if not self._pending:
            return
        keys = np.concatenate([self._keys, *(keys for keys, _ in self._pending)])
        points = np.concatenate([self._points, *(points for _, points in self._pending)])
        self._keys, first = np.unique(keys, return_index=True)
        self._points = points[first]
        self._pending, self._pending_count = [], 0
