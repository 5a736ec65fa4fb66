"""Truncated distance field: distances to the nearest point, precomputed on a voxel grid."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Points, Vector, frozen
from scanlock.errors import InvalidInput, require_positive

_MAX_EXTENT = 80.0
"""Distance from the median along an axis beyond which points are left out [m].

Outliers would otherwise determine the size of the grid.
"""


@dataclass(frozen=True, slots=True, eq=False)
class DistanceField:
    """Truncated distances to the nearest point on a voxel grid; build with `from_points`.

    Attributes
    ----------
    distances : (a, b, c) [m]
        Distance from the centre of each voxel to the centre of the nearest occupied voxel.
    corner : (3,) [m]
        Lowest corner of the voxel (0, 0, 0).
    voxel_size : float [m]
        Side of a voxel.
    truncation : float [m]
        Largest distance; also the distance of queries outside the grid.
    """

    distances: NDArray[np.float64]
    corner: Vector
    voxel_size: float
    truncation: float

    def __post_init__(self) -> None:
        for array in (self.distances, self.corner):
            frozen(array)

    @classmethod
    def from_points(cls, points: Points, voxel_size: float, truncation: float) -> "DistanceField":
        """Compute the distance field of points.

        Parameters
        ----------
        points : (n, 3) [m]
            Points.
        voxel_size : float [m]
            Side of the voxels.
        truncation : float [m]
            Largest distance.

        Raises
        ------
        InvalidInput
            No point, or a voxel size or truncation that is not positive.
        """
        from scipy.ndimage import distance_transform_edt

        require_positive("voxel_size", voxel_size, unit="m")
        require_positive("truncation", truncation, unit="m")
        if len(points) == 0:
            raise InvalidInput("points must contain at least one point, got none")
        near = points[(np.abs(points - np.median(points, axis=0)) <= _MAX_EXTENT).all(axis=1)]
        if len(near) == 0:
            # A cloud this wide has its median between its points.
            return cls(np.full((1, 1, 1), truncation), points[0], voxel_size, truncation)
        corner = near.min(axis=0) - truncation
        extent = near.max(axis=0) + truncation - corner
        shape = np.floor(extent / voxel_size).astype(np.int64) + 1
        is_free = np.ones(shape, np.bool_)
        is_free[tuple(np.floor((near - corner) / voxel_size).astype(np.int64).T)] = False
        distances = np.asarray(distance_transform_edt(is_free, sampling=voxel_size), np.float64)
        return cls(np.minimum(distances, truncation), corner, float(voxel_size), float(truncation))

    def at(self, queries: Points) -> Vector:
        """Return the (m,) distances [m] of (m, 3) queries, accurate to about a voxel."""
        # Simulated annealing looks up a few hundred points at thousands of poses, so that NumPy's
        # overhead counts: one flat index is twice as fast as three of a mask.
        _, rows, columns = self.distances.shape
        cells = np.floor((queries - self.corner) / self.voxel_size)
        inside = np.minimum(np.maximum(cells, 0.0), np.subtract(self.distances.shape, 1.0))
        indices = (inside @ np.array([rows * columns, columns, 1.0])).astype(np.intp)
        distances = self.distances.ravel().take(indices)
        x, y, z = (cells != inside).T
        distances[x | y | z] = self.truncation
        return distances
