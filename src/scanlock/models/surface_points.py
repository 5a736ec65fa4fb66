"""Points with the covariance of the surface around each, singly or by the voxel."""

from dataclasses import dataclass

from scanlock.arrays import Labels, Matrix, Points, frozen, read_only
from scanlock.clouds.voxel_grid import voxel_cells
from scanlock.errors import InvalidInput
from scanlock.kernels.gaussians.cells import cell_table, rows_at
from scanlock.kernels.points.surface_voxels import voxel_surfaces


@dataclass(frozen=True, slots=True, eq=False)
class SurfacePoints:
    """Points, each a Gaussian that lies along the surface it was taken from.

    Attributes
    ----------
    points : (n, 3) [m]
    covariances : (n, 6) [m^2]
        Packed upper triangles xx, xy, xz, yy, yz, zz; see
        `scanlock.models.surfaces.surface_covariances`.
    """

    points: Points
    covariances: Matrix

    def __post_init__(self) -> None:
        n = len(self.points)
        if self.points.shape != (n, 3) or self.covariances.shape != (n, 6):
            raise InvalidInput(
                "points and covariances must have shapes (n, 3) and (n, 6), got "
                f"{self.points.shape} and {self.covariances.shape}"
            )
        frozen(self.points)
        # One layout of memory, so that kernels are compiled once.
        object.__setattr__(self, "covariances", read_only(self.covariances))

    def __len__(self) -> int:
        return len(self.points)


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceVoxels:
    """The surface by the voxel, as in Koide et al. 2021. Build with `from_points`.

    Attributes
    ----------
    surface : SurfacePoints
        Of each voxel the mean of its points, and the mean of their covariances.
    places : (k, 3)
        Where the voxels lie, in widths from zero, in ascending order.
    table : (2^m,)
        The hash of the places: rows, and -1 where empty.
    width : float [m]
        Side of a voxel.
    """

    surface: SurfacePoints
    places: Labels
    table: Labels
    width: float

    def __post_init__(self) -> None:
        for array in (self.places, self.table):
            frozen(array)

    @classmethod
    def from_points(cls, surface: SurfacePoints, width: float) -> "SurfaceVoxels":
        """Return the occupied voxels of side `width` [m], one corner of one at zero."""
        points = read_only(surface.points)
        labels, places = voxel_cells(points, width)
        means, covariances = voxel_surfaces(
            points, surface.covariances, read_only(labels), len(places)
        )
        table = cell_table(read_only(places), 1 << (8 * len(places)).bit_length())
        return cls(SurfacePoints(means, covariances), places, table, float(width))

    def __len__(self) -> int:
        return len(self.surface)

    def rows_of(self, queries: Points) -> Labels:
        """Return the row of the voxel that each of (m, 3) points lies in; -1 where it is empty."""
        return rows_at(read_only(queries), self.table, self.places, self.width)
