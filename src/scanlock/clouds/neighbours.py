"""Nearest-neighbour searches: a k-d tree or a Delaunay tessellation behind one protocol.

Madhavan and Messina 2003 search a tessellation of the model and name k-d trees as the faster
alternative. Both give the same distances; `PointTree` is several times as fast.
"""

from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np

from scanlock.arrays import Labels, Points, Vector, frozen, read_only
from scanlock.clouds.point_tree import PointTree
from scanlock.errors import InvalidInput
from scanlock.kernels.points.tessellation import nearest_vertices

Search = Literal["k-d tree", "delaunay"]
"""Data structure of a nearest-neighbour search; the results are the same."""


class NearestNeighbours(Protocol):
    """Nearest-neighbour search in a fixed set of points."""

    @property
    def points(self) -> Points:
        """(n, 3) points [m]; searches return their rows."""
        ...

    def nearest(self, queries: Points, max_distance: float = np.inf) -> tuple[Labels, Vector]:
        """Find the nearest neighbour of each of (m, 3) queries [m].

        Returns its (m,) row and the (m,) distance [m]: -1 and infinity where no point is nearer
        than `max_distance` [m].
        """
        ...


def nearest_neighbours(tree: PointTree, search: Search) -> NearestNeighbours:
    """Return a search in the points of a tree, with the rows of the tree.

    Raises
    ------
    InvalidInput
        Unknown `search`.
    """
    if search == "k-d tree":
        return tree
    if search == "delaunay":
        return Tessellation.from_points(tree.points)
    raise InvalidInput(f"search must be 'k-d tree' or 'delaunay', got {search!r}")


@dataclass(frozen=True, slots=True, eq=False)
class Tessellation:
    """Edges of the Delaunay tessellation of points; build with `from_points`.

    Attributes
    ----------
    points : (n, 3) [m]
        Points.
    starts : (n + 1,)
        Point i has the neighbours ``neighbours[starts[i]:starts[i + 1]]``.
    neighbours : (e,)
        Rows of the points that share an edge.
    entry : int
        Vertex where the first search starts.
    left_out : (k,)
        Rows that are not vertices: duplicate points, and all points of a planar cloud.
    rest : PointTree or None
        Tree of the points that are not vertices. It is searched as well, so that the result is
        exact for any points.
    """

    points: Points
    starts: Labels
    neighbours: Labels
    entry: int
    left_out: Labels
    rest: PointTree | None

    def __post_init__(self) -> None:
        for array in (self.points, self.starts, self.neighbours, self.left_out):
            frozen(array)

    @classmethod
    def from_points(cls, points: Points) -> "Tessellation":
        """Compute the tessellation of finite (n, 3) points [m].

        Raises
        ------
        InvalidInput
            No point.
        """
        if len(points) == 0:
            raise InvalidInput("points must contain at least one point, got none")
        starts, neighbours = _edges(points)
        left_out = np.flatnonzero(np.diff(starts) == 0)
        entry = int(np.argmax(np.diff(starts)))
        rest = PointTree.from_points(points[left_out]) if len(left_out) else None
        return cls(read_only(points), starts, neighbours, entry, left_out, rest)

    def __len__(self) -> int:
        return len(self.points)

    def nearest(self, queries: Points, max_distance: float = np.inf) -> tuple[Labels, Vector]:
        """Find the nearest neighbour of each query by a walk along the edges.

        Parameters
        ----------
        queries : (m, 3) [m]
            Query points; the search is fastest when consecutive ones are close to each other.
        max_distance : float [m]
            Distance below which a neighbour is accepted.

        Returns
        -------
        rows : (m,)
            Row of the nearest point; -1 without a neighbour.
        distances : (m,) [m]
            Distance to it; infinite without a neighbour.
        """
        queries = read_only(queries)
        rows, distances = nearest_vertices(
            self.points, self.starts, self.neighbours, queries, self.entry
        )
        if self.rest is not None:
            rest_rows, rest_distances = self.rest.nearest(queries)
            is_nearer = rest_distances < distances
            rows[is_nearer] = self.left_out[self.rest.rows[rest_rows[is_nearer]]]
            distances[is_nearer] = rest_distances[is_nearer]
        beyond = distances >= max_distance
        rows[beyond], distances[beyond] = -1, np.inf
        return rows, distances

    def __reduce__(self) -> tuple[Any, ...]:
        return Tessellation.from_points, (np.array(self.points),)


def _edges(points: Points) -> tuple[Labels, Labels]:
    """Return the edges of the tessellation by vertex; none for coplanar points."""
    from scipy.spatial import Delaunay, QhullError

    try:
        # Centred: Qhull squares the coordinates, which loses all digits far from the origin.
        starts, neighbours = Delaunay(points - np.median(points, axis=0)).vertex_neighbor_vertices
    except (QhullError, ValueError):
        # Fewer than five points, or all in one plane.
        return np.zeros(len(points) + 1, np.int64), np.zeros(0, np.int64)
    return starts.astype(np.int64), neighbours.astype(np.int64)
