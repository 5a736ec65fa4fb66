"""Point map with one point in each occupied voxel."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Labels, Points
from scanlock.errors import InvalidInput, require_positive

_HALF = 1 << 20
"""Voxels on either side of zero along each axis, so that three indices fit into 64 bits."""

_Rows = dict[str, NDArray[Any]]
"""Values by name, one row per voxel."""

_POINTS = ""
"""Name of the points among the values of the first points."""


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
        self._first: _Rows = {_POINTS: np.zeros((0, 3), np.float32)}
        self._sums: _Rows = {}
        self._pending: list[tuple[Labels, _Rows, _Rows]] = []
        self._pending_count = 0

    def add(
        self,
        points: Points,
        *,
        first: Mapping[str, NDArray[Any]] | None = None,
        means: Mapping[str, NDArray[Any]] | None = None,
    ) -> None:
        """Add points to the map.

        Parameters
        ----------
        points : (n, 3) [m]
        first : mapping of str to (n,), optional
            Values of which a voxel keeps that of its first point; the same names in every call.
        means : mapping of str to (n,), optional
            Values of which a voxel keeps the mean; the same names in every call. NaN is left out.

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
        sums: _Rows = {}
        for name, values in (means or {}).items():
            known = ~np.isnan(values)
            sums[name] = np.stack([np.where(known, values, 0.0), known], axis=1, dtype=np.float64)
        block = _by_voxel(keys, {_POINTS: points, **(first or {})}, sums)
        block[1][_POINTS] = block[1][_POINTS].astype(np.float32)
        self._pending.append(block)
        self._pending_count += len(block[0])
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
        return self._first[_POINTS]

    @property
    def fields(self) -> dict[str, NDArray[Any]]:
        """The (n,) values of the kept points by name: those of the first points, then the means."""
        self._merge()
        first = {name: values for name, values in self._first.items() if name != _POINTS}
        with np.errstate(invalid="ignore"):
            means = {name: sums[:, 0] / sums[:, 1] for name, sums in self._sums.items()}
        return first | means

    def _merge(self) -> None:
        if not self._pending:
            return
        # The first scan of a map brings the names.
        blocks = [(self._keys, self._first, self._sums), *self._pending]
        blocks = blocks if len(self._keys) else blocks[1:]
        self._keys, self._first, self._sums = _by_voxel(
            np.concatenate([keys for keys, _, _ in blocks]),
            _concatenated([first for _, first, _ in blocks]),
            _concatenated([sums for _, _, sums in blocks]),
        )
        self._pending, self._pending_count = [], 0


def _by_voxel(keys: Labels, first: _Rows, sums: _Rows) -> tuple[Labels, _Rows, _Rows]:
    """Return the sorted unique keys with the first row and the sum of the rows of each."""
    order = np.argsort(keys, kind="stable")
    ordered = keys[order]
    starts = np.flatnonzero(np.diff(ordered, prepend=ordered[:1] - 1))
    rows = order[starts]
    totals = {
        name: np.add.reduceat(values[order], starts) if len(starts) else values
        for name, values in sums.items()
    }
    return ordered[starts], {name: values[rows] for name, values in first.items()}, totals


def _concatenated(blocks: list[_Rows]) -> _Rows:
    return {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}
