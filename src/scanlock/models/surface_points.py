"""Points with surface covariances, as single points and as averages over voxels."""

from dataclasses import dataclass

from scanlock.arrays import Labels, Matrix, Points, frozen, read_only, short_repr
from scanlock.clouds.voxel_grid import voxel_indices
from scanlock.errors import InvalidInput
from scanlock.kernels.gaussians.cells import cell_rows, cell_table
from scanlock.kernels.points.surface_voxels import voxel_averages


@dataclass(frozen=True, slots=True, eq=False)
class SurfacePoints:
    """Points with the covariance of the surface around each of them.

    Attributes
    ----------
    points : (n, 3) [m]
        Points on surfaces.
    covariances : (n, 6) [m^2]
        Covariances, packed as xx, xy, xz, yy, yz, zz; see
        `scanlock.models.surfaces.surface_covariances`.

    Raises
    ------
    InvalidInput
        Shapes that do not match.
    """

    points: Points
    covariances: Matrix

    __repr__ = short_repr

    def __post_init__(self) -> None:
        n = len(self.points)
        if self.points.shape != (n, 3) or self.covariances.shape != (n, 6):
            raise InvalidInput(
                "points and covariances must have shapes (n, 3) and (n, 6), got "
                f"{self.points.shape} and {self.covariances.shape}"
            )
        frozen(self.points)
        # A single memory layout, so that kernels are compiled once.
        object.__setattr__(self, "covariances", read_only(self.covariances))

    def __len__(self) -> int:
        return len(self.points)


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceVoxels:
    """Surface points averaged over voxels (Koide et al. 2021); build with `from_points`.

    Attributes
    ----------
    surface : SurfacePoints
        Mean of the points and mean of their covariances in each occupied voxel.
    indices : (k, 3)
        Integer grid indices of the voxels, in ascending order; voxel (0, 0, 0) has a corner at
        the origin.
    table : (2^m,)
        Hash table of the indices: rows of `indices`, -1 where empty.
    size : float [m]
        Side of a voxel.
    """

    surface: SurfacePoints
    indices: Labels
    table: Labels
    size: float

    def __post_init__(self) -> None:
        for array in (self.indices, self.table):
            frozen(array)

    @classmethod
    def from_points(cls, surface: SurfacePoints, voxel_size: float) -> "SurfaceVoxels":
        """Average surface points over voxels of side `voxel_size` [m]."""
        points = read_only(surface.points)
        labels, indices = voxel_indices(points, voxel_size)
        means, covariances = voxel_averages(
            points, surface.covariances, read_only(labels), len(indices)
        )
        table = cell_table(read_only(indices), 1 << (8 * len(indices)).bit_length())
        return cls(SurfacePoints(means, covariances), indices, table, float(voxel_size))

    def __len__(self) -> int:
        return len(self.surface)

    def rows_of(self, queries: Points) -> Labels:
        """Return the (m,) row of the voxel that contains each query [m]; -1 for empty voxels."""
        return cell_rows(read_only(queries), self.table, self.indices, self.size)
