"""k-d tree for nearest-neighbour searches."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector, frozen, read_only, short_repr
from scanlock.errors import InvalidInput, require_count
from scanlock.kernels.points.leaf_covariances import knn_covariances
from scanlock.kernels.points.point_tree import (
    build_kd_tree,
    k_nearest_neighbours,
    nearest_neighbours,
)
from scanlock.kernels.points.surfaces import neighbour_covariances

_LEAF_SIZE = 16
"""Maximum number of points of a leaf; 10 to 30 are equally fast on scans of 0.25 m voxels."""


@dataclass(frozen=True, slots=True, eq=False)
class PointTree:
    """k-d tree of points; build with `from_points`.

    Searches return rows of `points`; ``tree.rows[row]`` is the row of the input array.

    Attributes
    ----------
    points : (n, 3) [m]
        Points in the order of the leaves: neighbours in space are neighbours in memory.
    rows : (n,)
        Row of the input array of each point.
    split_axes : (c,)
        Axis that each inner node splits.
    split_values : (c,) [m]
        Coordinate along that axis at which the node splits.
    """

    points: Points
    rows: Labels
    split_axes: Labels
    split_values: Vector

    __repr__ = short_repr

    def __post_init__(self) -> None:
        for array in (self.points, self.rows, self.split_axes, self.split_values):
            frozen(array)

    @classmethod
    def from_points(cls, points: Points) -> "PointTree":
        """Build the tree of finite (n, 3) points [m].

        Raises
        ------
        InvalidInput
            No point.
        """
        if len(points) == 0:
            raise InvalidInput("points must contain at least one point, got none")
        rows, split_axes, split_values = build_kd_tree(read_only(points), _LEAF_SIZE)
        return cls(points[rows], rows, split_axes, split_values)

    def __len__(self) -> int:
        return len(self.points)

    def nearest(self, queries: Points, max_distance: float = np.inf) -> tuple[Labels, Vector]:
        """Find the nearest neighbour of each query.

        Parameters
        ----------
        queries : (m, 3) [m]
            Query points.
        max_distance : float [m]
            Distance below which a neighbour is accepted; a finite one makes the search faster.

        Returns
        -------
        rows : (m,)
            Row of the nearest point; -1 without a neighbour.
        distances : (m,) [m]
            Distance to it; infinite without a neighbour.
        """
        return nearest_neighbours(
            self.points,
            self.split_axes,
            self.split_values,
            read_only(queries),
            float(max_distance),
        )

    def neighbours(self, count: int, rows: Labels | None = None) -> Labels:
        """Find the nearest neighbours of the points themselves.

        Parameters
        ----------
        count : int
            Number of neighbours of a point, itself included.
        rows : (m,), optional
            Rows of the query points; all by default.

        Returns
        -------
        (m, count)
            Rows of the neighbours, nearest first. The first is the point itself, or one at the
            same position.

        Raises
        ------
        InvalidInput
            `count` is not a whole number from 1 to the number of points.
        """
        return self.neighbours_of(self.points if rows is None else self.points[rows], count)

    def neighbours_of(self, queries: Points, count: int) -> Labels:
        """Find the nearest points of each query.

        Parameters
        ----------
        queries : (m, 3) [m]
            Query points.
        count : int
            Number of neighbours of a query.

        Returns
        -------
        (m, count)
            Rows of the neighbours, nearest first.

        Raises
        ------
        InvalidInput
            As `neighbours`.
        """
        self._require_neighbours(count)
        return k_nearest_neighbours(
            self.points, self.split_axes, self.split_values, read_only(queries), count
        )

    def neighbour_covariances(self, count: int) -> Matrix:
        """Return the (n, 6) covariances [m^2] of the `count` nearest neighbours of each point.

        They are packed as xx, xy, xz, yy, yz, zz and divided by `count`; a point is its own
        neighbour.

        Raises
        ------
        InvalidInput
            As `neighbours`.
        """
        self._require_neighbours(count)
        covariances, is_known = knn_covariances(
            self.points, self.split_axes, self.split_values, count
        )
        remaining = np.flatnonzero(~is_known)
        neighbours = read_only(self.neighbours(count, remaining))
        covariances[remaining] = neighbour_covariances(self.points, neighbours)
        return covariances

    def _require_neighbours(self, count: int) -> None:
        require_count("count", count)
        if count > len(self):
            raise InvalidInput(
                f"count must be at most {len(self)}, the number of points, got {count}"
            )

    def __reduce__(self) -> tuple[Any, ...]:
        return PointTree, tuple(
            np.array(array)
            for array in (self.points, self.rows, self.split_axes, self.split_values)
        )
