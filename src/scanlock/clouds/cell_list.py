"""Cell list: points sorted by the voxel that contains them, for searches within a radius."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Matrix, Points, frozen, read_only, short_repr
from scanlock.errors import require_positive
from scanlock.kernels.points.neighbourhood_sums import sorted_by_voxel, sums_within_radius


@dataclass(frozen=True, slots=True, eq=False)
class CellList:
    """Points sorted by voxel; build with `of_points`.

    Attributes
    ----------
    points : (n, 3) [m]
        Points, sorted by the hash slots of their voxels.
    starts : (s + 1,) int32
        Slot i has the points ``starts[i]:starts[i + 1]``.
    voxel_size : float [m]
        Side of the voxels; about twice the search radius is fastest.

    Raises
    ------
    InvalidInput
        `voxel_size` is not positive.
    """

    points: Points
    starts: NDArray[np.int32]
    voxel_size: float

    __repr__ = short_repr

    def __post_init__(self) -> None:
        require_positive("voxel_size", self.voxel_size, unit="m")
        frozen(self.points)
        frozen(self.starts)

    @classmethod
    def of_points(cls, points: Points, voxel_size: float) -> "CellList":
        """Sort (n, 3) points [m] by voxels of side `voxel_size` [m]."""
        require_positive("voxel_size", voxel_size, unit="m")
        return cls(*sorted_by_voxel(points, float(voxel_size)), float(voxel_size))

    def sums_within_radius(self, queries: Points, radius: float) -> Matrix:
        """Return sums over the points within a radius of each query.

        Parameters
        ----------
        queries : (m, 3) [m]
            Query points.
        radius : float [m]
            Search radius; points at exactly this distance are not included.

        Returns
        -------
        (m, 10)
            For the offsets d from the query: their number, the sum of d [m], and the upper
            triangle of the sum of ``d d'`` [m^2].
        """
        queries = read_only(queries)
        return sums_within_radius(self.points, self.starts, self.voxel_size, queries, float(radius))
