"""Nearest-neighbour search with a cache for queries that move little between searches."""

from dataclasses import dataclass, field

import numpy as np

from scanlock.arrays import Labels, Points, Vector, read_only
from scanlock.clouds.neighbours import NearestNeighbours
from scanlock.clouds.point_tree import PointTree
from scanlock.kernels.points.point_tree import cached_nearest_neighbours


@dataclass(slots=True, eq=False)
class CachedNeighbours:
    """Repeated nearest-neighbour search in a tree for slowly moving queries.

    The results are those of the tree. Each search also bounds the distance to all other points. By
    the triangle inequality, a query that has moved by less than the bound allows keeps its
    neighbour without a search.

    Attributes
    ----------
    tree : PointTree
        Tree of the points.
    """

    tree: PointTree
    _anchors: Points = field(init=False, default_factory=lambda: np.zeros((0, 3)))
    _rows: Labels = field(init=False, default_factory=lambda: np.zeros(0, np.int64))
    _bounds: Vector = field(init=False, default_factory=lambda: np.zeros(0))
    _typical: float = field(init=False, default=0.0)

    @property
    def points(self) -> Points:
        """(n, 3) points [m]; searches return their rows."""
        return self.tree.points

    def nearest(self, queries: Points, max_distance: float = np.inf) -> tuple[Labels, Vector]:
        """Find the nearest neighbour of each query; see `PointTree.nearest`.

        Query i is expected close to query i of the previous search.
        """
        if len(queries) != len(self._rows):
            self._anchors = np.array(queries, np.float64, order="C")
            self._rows = np.full(len(queries), -1, np.int64)
            self._bounds = np.full(len(queries), -np.inf)
        tree = self.tree
        rows, distances, self._typical = cached_nearest_neighbours(
            tree.points, tree.split_axes, tree.split_values, read_only(queries),
            float(max_distance), self._typical, self._anchors, self._rows, self._bounds,
        )  # fmt: skip
        return rows, distances


def cached_neighbours(search: NearestNeighbours) -> NearestNeighbours:
    """Return the search with a cache where that is faster: for a tree."""
    return CachedNeighbours(search) if isinstance(search, PointTree) else search
