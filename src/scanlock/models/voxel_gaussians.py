"""Gaussians of the points in each cell of a voxel grid: the distributions of NDT."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from scanlock.arrays import Labels, Points, Vector, frozen, short_repr
from scanlock.clouds.voxel_grid import voxel_moments
from scanlock.errors import require_at_least, require_count, require_fraction, require_positive
from scanlock.kernels.gaussians.cells import cell_table
from scanlock.models.gaussians import Gaussians


@dataclass(frozen=True, eq=False)
class VoxelGaussians:
    """Gaussians of the occupied cells of a voxel grid.

    Attributes
    ----------
    gaussians : Gaussians
        Gaussian of each cell with enough points, in the order of `cells`.
    cells : (k, 3)
        Integer grid index of each Gaussian's cell, in ascending order.
    corner : (3,) [m]
        Lowest corner of the cell (0, 0, 0).
    size : float [m]
        Side of the cells.
    """

    gaussians: Gaussians
    cells: Labels
    corner: Vector
    size: float

    __repr__ = short_repr

    def __post_init__(self) -> None:
        for array in (self.cells, self.corner):
            frozen(array)

    def __len__(self) -> int:
        return len(self.gaussians)

    @cached_property
    def table(self) -> Labels:
        """The (2^m,) hash table of the cells, at most 1/8 full: rows, -1 where empty."""
        table = cell_table(self.cells, 1 << (8 * len(self.cells)).bit_length())
        frozen(table)
        return table

    def __reduce__(self) -> tuple[Any, ...]:
        return VoxelGaussians, (
            self.gaussians,
            np.array(self.cells),
            np.array(self.corner),
            self.size,
        )


@dataclass(frozen=True, kw_only=True, slots=True)
class VoxelGrid:
    """Settings of the voxel grid and of the regularisation of its Gaussians."""

    min_points: int = 6
    """Minimum number of points of a cell with a Gaussian; 6 in the Point Cloud Library."""

    variance_ratio: float = 0.01
    """Minimum variance relative to the largest of the same Gaussian (Magnusson 2009)."""

    min_deviation: float = 0.01
    """Minimum standard deviation of a Gaussian along any axis [m]: the noise of a good sensor."""

    offset: float = 0.0
    """Position of the lowest corner of the grid along each axis, as a fraction of the cell size."""

    def __post_init__(self) -> None:
        # An unbiased covariance needs two points.
        require_count("min_points", self.min_points, 2)
        require_fraction("variance_ratio", self.variance_ratio)
        require_positive("min_deviation", self.min_deviation, unit="m")
        require_fraction("offset", self.offset)

    def gaussians(self, points: Points, voxel_size: float) -> VoxelGaussians:
        """Fit Gaussians to (n, 3) points [m] in cells of side `voxel_size` [m].

        Covariances are unbiased: divided by the count less one.

        Raises
        ------
        InvalidInput
            `voxel_size` is less than 0.01 m.
        """
        require_at_least("voxel_size", voxel_size, 0.01, unit="m")
        corner = np.full(3, self.offset * voxel_size)
        cells, counts, means, packed = voxel_moments(points, voxel_size, corner, self.min_points)
        unbiased = packed * (counts / (counts - 1.0))[:, None]
        return VoxelGaussians(
            Gaussians(means, unbiased, counts).regularised(self.min_deviation, self.variance_ratio),
            cells,
            corner,
            voxel_size,
        )
