"""Nearest points: a k-d tree built once, for any number of queries."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector, frozen, read_only
from scanlock.errors import InvalidInput, require_count
from scanlock.kernels.points.leaf_covariances import leaf_covariances
from scanlock.kernels.points.point_tree import (
    nearest_rows,
    several_nearest_rows,
    sorted_into_leaves,
)
from scanlock.kernels.points.surfaces import neighbour_covariances

_LARGEST_LEAF = 16
"""Points in a leaf; 10 to 30 are equally fast on scans thinned to 0.25 m."""


@dataclass(frozen=True, slots=True, eq=False)
class PointTree:
    """Points in the order of the leaves of their k-d tree; build one with `from_points`.

    All rows that a search returns are rows of `points` here; ``rows`` leads back to the caller's.

    Attributes
    ----------
    points : (n, 3) [m]
        The points sorted into leaves: neighbours in space are neighbours in memory.
    rows : (n,)
        The row of the caller's array that each point came from.
    axes : (c,)
        Axis across which each node is cut.
    places : (c,) [m]
        Where along its axis.
    """

    points: Points
    rows: Labels
    axes: Labels
    places: Vector

    def __post_init__(self) -> None:
        for array in (self.points, self.rows, self.axes, self.places):
            frozen(array)

    @classmethod
    def from_points(cls, points: Points) -> "PointTree":
        """Return the tree of finite (n, 3) points.

        Raises
        ------
        InvalidInput
            No point.
        """
        if len(points) == 0:
            raise InvalidInput("points must hold at least one point, got none")
        rows, axes, places = sorted_into_leaves(read_only(points), _LARGEST_LEAF)
        return cls(points[rows], rows, axes, places)

    def __len__(self) -> int:
        return len(self.points)

    def nearest(self, queries: Points, limit: float = np.inf) -> tuple[Labels, Vector]:
        """Return the row of the point nearest to each of (m, 3) queries, and the distance.

        Parameters
        ----------
        queries : (m, 3) [m]
        limit : float [m]
            Points this far away or farther do not count: the row is then -1 and the distance
            infinite. A limit makes the search faster.
        """
        return nearest_rows(self.points, self.axes, self.places, read_only(queries), float(limit))

    def neighbours(self, count: int, of: Labels | None = None) -> Labels:
        """Return (m, count) the rows of the points nearest to some of the points, nearest first.

        A point is its own first neighbour, or shares its place with it.

        Parameters
        ----------
        count : int
            Neighbours of a point, itself included.
        of : (m,), optional
            Rows of those points; all by default.

        Raises
        ------
        InvalidInput
            `count` is not a whole number from 1 to the number of points.
        """
        self._require_neighbours(count)
        queries = self.points if of is None else read_only(self.points[of])
        return several_nearest_rows(self.points, self.axes, self.places, queries, count)

    def neighbour_covariances(self, count: int) -> Matrix:
        """Return (n, 6) the covariances [m^2] of the `count` points nearest to each point.

        Packed as xx, xy, xz, yy, yz, zz and divided by `count`; a point is one of its neighbours.

        Raises
        ------
        InvalidInput
            As `neighbours`.
        """
        self._require_neighbours(count)
        covariances, is_known = leaf_covariances(self.points, self.axes, self.places, count)
        left = np.flatnonzero(~is_known)
        rows = read_only(self.neighbours(count, left))
        covariances[left] = neighbour_covariances(self.points, rows)
        return covariances

    def _require_neighbours(self, count: int) -> None:
        require_count("count", count)
        if count > len(self):
            raise InvalidInput(f"count must be at most the {len(self)} points, got {count}")

    def __reduce__(self) -> tuple[Any, ...]:
        return PointTree, tuple(
            np.array(array) for array in (self.points, self.rows, self.axes, self.places)
        )
