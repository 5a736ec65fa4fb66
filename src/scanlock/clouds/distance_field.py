"""How far it is to the nearest point, precomputed on a grid: one look-up a query."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Points, Vector, frozen
from scanlock.errors import InvalidInput, require_positive

_FARTHEST = 80.0
"""Points farther than this from the median of all are left out [m]: strays would size the grid."""


@dataclass(frozen=True, slots=True, eq=False)
class DistanceField:
    """Distances to the nearest of some points, at most `truncation`; build with `from_points`.

    Attributes
    ----------
    distances : (a, b, c) [m]
        From the middle of each cube to the middle of the nearest cube that holds a point.
    corner : (3,) [m]
        Of the first cube.
    width : float [m]
        Side of a cube.
    truncation : float [m]
        No distance is larger, and none is known beyond the grid.
    """

    distances: NDArray[np.float64]
    corner: Vector
    width: float
    truncation: float

    def __post_init__(self) -> None:
        for array in (self.distances, self.corner):
            frozen(array)

    @classmethod
    def from_points(cls, points: Points, width: float, truncation: float) -> "DistanceField":
        """Return the field of (n, 3) points, in cubes of side `width` [m]."""
        from scipy.ndimage import distance_transform_edt

        require_positive("width", width, unit="m")
        require_positive("truncation", truncation, unit="m")
        if len(points) == 0:
            raise InvalidInput("points must hold at least one point, got none")
        near = points[(np.abs(points - np.median(points, axis=0)) <= _FARTHEST).all(axis=1)]
        corner = near.min(axis=0) - truncation
        shape = np.floor((near.max(axis=0) + truncation - corner) / width).astype(np.int64) + 1
        is_free = np.ones(shape, np.bool_)
        is_free[tuple(np.floor((near - corner) / width).astype(np.int64).T)] = False
        distances = np.asarray(distance_transform_edt(is_free, sampling=width), np.float64)
        return cls(np.minimum(distances, truncation), corner, float(width), float(truncation))

    def at(self, queries: Points) -> Vector:
        """Return the (m,) distance [m] of each query, good to about the width."""
        cells = np.floor((queries - self.corner) / self.width).astype(np.int64)
        is_inside = ((cells >= 0) & (cells < self.distances.shape)).all(axis=1)
        found = np.full(len(queries), self.truncation)
        found[is_inside] = self.distances[tuple(cells[is_inside].T)]
        return found
