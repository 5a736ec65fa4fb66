"""The points of a cloud sorted by the cube they lie in, to look around a place without a tree."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Matrix, Points, frozen, read_only
from scanlock.errors import require_positive
from scanlock.kernels.points.neighbourhood_sums import sorted_by_cube, sums_near


@dataclass(frozen=True, slots=True, eq=False)
class CellList:
    """Points by cube.

    Attributes
    ----------
    points : (n, 3) [m]
        Sorted by the slots that their cubes fall in.
    starts : (s + 1,) int32
        The first row of each slot.
    edge : float [m]
        Side of the cubes; about twice the radius of the balls that are looked at most.
    """

    points: Points
    starts: NDArray[np.int32]
    edge: float

    def __post_init__(self) -> None:
        require_positive("edge", self.edge, unit="m")
        frozen(self.points)
        frozen(self.starts)

    @classmethod
    def of_points(cls, points: Points, edge: float) -> "CellList":
        """Return the list of (n, 3) points [m]."""
        require_positive("edge", edge, unit="m")
        return cls(*sorted_by_cube(points, float(edge)), float(edge))

    def sums_near(self, places: Points, radius: float) -> Matrix:
        """Return (m, 10) sums over the points nearer than `radius` [m] to each of (m, 3) places.

        Of the offsets d from the place: how many, ``d``, and the upper triangle of ``d d'``.
        """
        return sums_near(self.points, self.starts, self.edge, read_only(places), float(radius))
