"""A scan as one Gaussian for each cube of a grid: the distributions of NDT."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from scanlock.arrays import Labels, Points, Vector, frozen
from scanlock.clouds.voxel_grid import voxel_moments
from scanlock.errors import require_at_least, require_count, require_fraction, require_positive
from scanlock.kernels.gaussians.cells import cell_table
from scanlock.models.gaussians import Gaussians


@dataclass(frozen=True, eq=False)
class VoxelGaussians:
    """The Gaussians of the occupied cells of a grid.

    Attributes
    ----------
    gaussians : Gaussians
        One for each cell with enough points, by ascending cell.
    cells : (k, 3)
        Whole numbers: the cell of each Gaussian in widths from the corner.
    corner : (3,) [m]
        A corner of the cell (0, 0, 0).
    width : float [m]
        Side of the cells.
    """

    gaussians: Gaussians
    cells: Labels
    corner: Vector
    width: float

    def __post_init__(self) -> None:
        for array in (self.cells, self.corner):
            frozen(array)

    def __len__(self) -> int:
        return len(self.gaussians)

    @cached_property
    def table(self) -> Labels:
        """The (2^m,) hash of the cells, at most an eighth full: rows, and -1 where empty."""
        table = cell_table(self.cells, 1 << (8 * len(self.cells)).bit_length())
        frozen(table)
        return table

    def __reduce__(self) -> tuple[Any, ...]:
        return VoxelGaussians, (
            self.gaussians,
            np.array(self.cells),
            np.array(self.corner),
            self.width,
        )


@dataclass(frozen=True, kw_only=True, slots=True)
class VoxelGrid:
    """Settings of the grid and of what becomes of the points of a cell."""

    min_points: int = 6
    """Cells of fewer points are left out; 6 in the Point Cloud Library."""

    variance_ratio: float = 0.01
    """Variances are raised to this share of the largest of their Gaussian (Magnusson 2009)."""

    min_deviation: float = 0.01
    """Least standard deviation of a Gaussian along any axis [m]: the noise of a good sensor."""

    offset: float = 0.0
    """Where the corner of the grid lies along each axis, as a share of the width."""

    def __post_init__(self) -> None:
        # The spread of fewer points has no estimate.
        require_count("min_points", self.min_points, 2)
        require_fraction("variance_ratio", self.variance_ratio)
        require_positive("deviation_floor", self.min_deviation, unit="m")
        require_fraction("offset", self.offset)

    def gaussians(self, points: Points, width: float) -> VoxelGaussians:
        """Return the Gaussians of (n, 3) points [m] in cubes of side `width` [m].

        Covariances are divided by the count less one, as for any sample whose mean is its own.
        """
        require_at_least("width", width, 0.01, unit="m")
        corner = np.full(3, self.offset * width)
        cells, counts, means, packed = voxel_moments(points, width, corner, self.min_points)
        unbiased = packed * (counts / (counts - 1.0))[:, None]
        return VoxelGaussians(
            Gaussians(means, unbiased, counts).regularised(self.min_deviation, self.variance_ratio),
            cells,
            corner,
            width,
        )
