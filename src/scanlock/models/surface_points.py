"""Points with the covariance of the surface around each, singly or by the voxel."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Labels, Matrix, Points, Vector, frozen, read_only
from scanlock.clouds.voxel_grid import voxel_labels
from scanlock.errors import InvalidInput
from scanlock.kernels.surface_voxels import voxel_rows


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
    width : float [m]
        Side of a voxel.
    """

    surface: SurfacePoints
    places: NDArray[np.int64]
    width: float

    def __post_init__(self) -> None:
        frozen(self.places)

    @classmethod
    def from_points(cls, surface: SurfacePoints, width: float) -> "SurfaceVoxels":
        """Return the occupied voxels of side `width` [m], one corner of one at zero."""
        labels, count = voxel_labels(surface.points, width)
        sizes = np.bincount(labels, minlength=count)

        def mean(column: Vector) -> Vector:
            return np.bincount(labels, column, count) / sizes

        places = np.empty((count, 3), np.int64)
        # Labels ascend with the place, so that a place is found by bisection.
        places[labels] = np.floor(surface.points / width)
        means = np.stack([mean(column) for column in surface.points.T], axis=1)
        covariances = np.stack([mean(column) for column in surface.covariances.T], axis=1)
        return cls(SurfacePoints(means, covariances), places, float(width))

    def __len__(self) -> int:
        return len(self.surface)

    def rows_of(self, queries: Points) -> Labels:
        """Return the row of the voxel that each of (m, 3) points lies in; -1 where it is empty."""
        return voxel_rows(read_only(queries), self.places, self.width)
