"""Point map with one point in each occupied voxel."""

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Labels, Points
from scanlock.errors import InvalidInput, require_positive

_HALF = 1 << 20
"""Voxels on either side of zero along each axis, so that three indices fit into 64 bits."""


class VoxelMap:
    """A map that keeps the first point added to each voxel; its length is its crispness.

    Parameters
    ----------
    voxel_size : float [m]
        Side of a voxel. One corner of the voxel grid is at zero.

    Raises
    ------
    InvalidInput
        A size that is not positive.
    """

    def __init__(self, voxel_size: float) -> None:
        require_positive("voxel_size", voxel_size, unit="m")
        self._voxel_size = voxel_size
        self._keys: Labels = np.zeros(0, np.int64)
        self._points: NDArray[np.float32] = np.zeros((0, 3), np.float32)
        self._pending: list[tuple[Labels, NDArray[np.float32]]] = []
        self._pending_count = 0

    def add(self, points: Points) -> None:
        """Add points to the map.

        Parameters
        ----------
        points : (n, 3) [m]

        Raises
        ------
        InvalidInput
            Points of another shape, not finite, or more than a million voxels from zero.
        """
        if points.ndim != 2 or points.shape[1] != 3:
            raise InvalidInput(f"points must have shape (n, 3), got {points.shape}")
        index = np.floor(points / self._voxel_size)
        if not (np.abs(index) < _HALF).all():
            raise InvalidInput(
                f"points must be finite and within {_HALF * self._voxel_size:g} m of zero; "
                "subtract the map's origin first"
            )
        shifted = index.astype(np.int64) + _HALF
        keys = (shifted[:, 0] << 42) | (shifted[:, 1] << 21) | shifted[:, 2]
        keys, first = np.unique(keys, return_index=True)
        self._pending.append((keys, points[first].astype(np.float32)))
        self._pending_count += len(keys)
        # Merging when the pending points outnumber the merged ones costs n log n in total.
        if self._pending_count > len(self._keys):
            self._merge()

    def __len__(self) -> int:
        self._merge()
        return len(self._keys)

    @property
    def points(self) -> NDArray[np.float32]:
        """The (n, 3) kept points [m], sorted by voxel."""
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
