"""Terrain as a grid of heights with bilinear interpolation."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from scanlock.arrays import Matrix, Points, Vector, frozen, read_only, short_repr
from scanlock.errors import InvalidInput, require_positive
from scanlock.kernels.simulation.ray_ground import TILE


@dataclass(frozen=True, slots=True, eq=False)
class HeightField:
    """Heights of the ground over a rectangle of the x-y plane.

    Attributes
    ----------
    heights : (m, n) [m]
        ``heights[i, j]`` is the height at ``corner + cell * (i, j)``; at least 2 x 2.
    corner : (2,) [m]
        Position of the first height.
    cell : float [m]
        Distance between neighbouring heights.
    tops : (p, q) [m]
        Maximum height of each tile of cells, for ray casting.

    Raises
    ------
    InvalidInput
        Fewer than 2 x 2 heights, values that are not finite, or a cell that is not positive.
    """

    heights: Matrix
    corner: Vector
    cell: float
    tops: Matrix = field(init=False)

    __repr__ = short_repr

    def __post_init__(self) -> None:
        require_positive("cell", self.cell, unit="m")
        heights = np.array(self.heights, np.float64)
        corner = np.array(self.corner, np.float64)
        if heights.ndim != 2 or min(heights.shape) < 2:
            raise InvalidInput(f"heights must be a grid of at least (2, 2), got {heights.shape}")
        if corner.shape != (2,):
            raise InvalidInput(f"corner must have shape (2,), got {corner.shape}")
        if not (np.isfinite(heights).all() and np.isfinite(corner).all()):
            raise InvalidInput("heights and corner must be finite")
        for name, array in (("heights", heights), ("corner", corner), ("tops", _tops(heights))):
            frozen(array)
            object.__setattr__(self, name, array)

    @classmethod
    def level(cls, half_side: float) -> "HeightField":
        """Return level ground at z = 0, a square about the origin with half the side [m] given."""
        require_positive("half_side", half_side, unit="m")
        return cls(np.zeros((2, 2)), np.array([-half_side, -half_side]), 2.0 * half_side)

    @classmethod
    def sampled(
        cls,
        height: Callable[[Matrix], Vector],
        low: ArrayLike,
        high: ArrayLike,
        cell: float,
    ) -> "HeightField":
        """Sample a function of (n, 2) positions on the rectangle from `low` to at least `high`."""
        corner = np.asarray(low, np.float64)
        counts = np.ceil((np.asarray(high, np.float64) - corner) / cell).astype(int) + 1
        i, j = np.indices(tuple(counts))
        positions = corner + cell * np.column_stack([i.ravel(), j.ravel()])
        return cls(height(positions).reshape(i.shape), corner, cell)

    def at(self, positions: Matrix) -> Vector:
        """Return the (n,) heights [m] at (n, 2+) positions; outside, those of the nearest edge."""
        positions = np.asarray(positions, np.float64)
        last = np.array(self.heights.shape) - 1
        index = np.clip((positions[:, :2] - self.corner) / self.cell, 0.0, last)
        low = np.minimum(index.astype(np.int64), last - 1)
        u, v = (index - low).T
        i, j = low.T
        h = self.heights
        return (
            (1 - u) * (1 - v) * h[i, j]
            + u * (1 - v) * h[i + 1, j]
            + (1 - u) * v * h[i, j + 1]
            + u * v * h[i + 1, j + 1]
        )

    def lifted(self, positions: Matrix) -> Points:
        """Return the (n, 3) points on the ground at (n, 2+) positions."""
        positions = np.asarray(positions, np.float64)
        return np.column_stack([positions[:, :2], self.at(positions)])

    def __reduce__(self) -> tuple[Any, ...]:
        return HeightField, (np.array(self.heights), np.array(self.corner), self.cell)


def _tops(heights: Matrix) -> Matrix:
    """Return the maximum height of each tile of cells, including the heights on its border."""
    rows, columns = (-(-(length - 1) // TILE) for length in heights.shape)
    tops = np.empty((rows, columns))
    for i in range(rows):
        band = heights[i * TILE : (i + 1) * TILE + 1].max(axis=0)
        for j in range(columns):
            tops[i, j] = band[j * TILE : (j + 1) * TILE + 1].max()
    return read_only(tops)
