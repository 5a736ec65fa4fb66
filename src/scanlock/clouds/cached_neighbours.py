"""Nearest points of queries that move little from one search to the next."""

from dataclasses import dataclass, field

import numpy as np

from scanlock.arrays import Labels, Points, Vector, read_only
from scanlock.clouds.neighbours import ClosestPoints
from scanlock.clouds.point_tree import PointTree
from scanlock.kernels.points.point_tree import kept_nearest_rows


@dataclass(slots=True, eq=False)
class CachedNeighbours:
    """The points of a tree, searched again and again for queries that move a little each time.

    The answers are those of the tree. Each search also finds how near any other point may be, and
    by the triangle inequality most queries keep their nearest point without a search, once they
    move by less than the points are apart.
    """

    tree: PointTree
    _anchors: Points = field(init=False, default_factory=lambda: np.zeros((0, 3)))
    _rows: Labels = field(init=False, default_factory=lambda: np.zeros(0, np.int64))
    _bounds: Vector = field(init=False, default_factory=lambda: np.zeros(0))
    _typical: float = field(init=False, default=0.0)

    @property
    def points(self) -> Points:
        """(n, 3) the points [m], in the rows that a search answers."""
        return self.tree.points

    def nearest(self, queries: Points, limit: float = np.inf) -> tuple[Labels, Vector]:
        """Return the row of the point nearest to each of (m, 3) queries, and the distance.

        As `PointTree.nearest`; query i is taken for what query i of the last search has become.
        """
        if len(queries) != len(self._rows):
            self._anchors = np.array(queries, np.float64, order="C")
            self._rows = np.full(len(queries), -1, np.int64)
            self._bounds = np.full(len(queries), -np.inf)
        tree = self.tree
        rows, distances, self._typical = kept_nearest_rows(
            tree.points, tree.axes, tree.places, read_only(queries), float(limit),
            self._typical, self._anchors, self._rows, self._bounds,
        )  # fmt: skip
        return rows, distances


def cached_neighbours(closest: ClosestPoints) -> ClosestPoints:
    """Return the same points to be searched for queries that move little, where that is faster."""
    return CachedNeighbours(closest) if isinstance(closest, PointTree) else closest
