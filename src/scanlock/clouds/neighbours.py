"""Ways to find closest points, behind one protocol: a k-d tree, or a Delaunay tessellation.

Madhavan and Messina 2003 tessellate the model and search the tessellation; they name k-d trees as
the faster way. Both find the same distances, and `PointTree` finds them several times as fast.
"""

from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np

from scanlock.arrays import Labels, Points, Vector, frozen, read_only
from scanlock.clouds.point_tree import PointTree
from scanlock.errors import InvalidInput
from scanlock.kernels.points.tessellation import nearest_vertices

Search = Literal["k-d tree", "delaunay"]
"""How closest points are looked for; the answers are the same."""


class ClosestPoints(Protocol):
    """Points that can be searched."""

    @property
    def points(self) -> Points:
        """(n, 3) the points [m], in the rows that a search answers."""
        ...

    def nearest(self, queries: Points, limit: float = np.inf) -> tuple[Labels, Vector]:
        """Return the row of the point nearest to each of (m, 3) queries, and the distance [m].

        Points `limit` [m] away or farther do not count: -1 and Inf where no other is.
        """
        ...


def closest_points(tree: PointTree, search: Search) -> ClosestPoints:
    """Return the points of a tree, to be searched one way or the other, in the same rows."""
    if search == "k-d tree":
        return tree
    if search == "delaunay":
        return Tessellation.from_points(tree.points)
    raise InvalidInput(f"search must be 'k-d tree' or 'delaunay', got {search!r}")


@dataclass(frozen=True, slots=True, eq=False)
class Tessellation:
    """The edges of the Delaunay tessellation of points; build one with `from_points`.

    Attributes
    ----------
    points : (n, 3) [m]
    starts : (n + 1,)
        The neighbours of point i are ``neighbours[starts[i]:starts[i + 1]]``.
    neighbours : (e,)
        Rows of points that share an edge.
    entry : int
        The vertex where a search begins.
    left_out : (k,)
        Rows that are no vertex, because Qhull cannot tell them from the surface of others: equal
        points, and all points of a plane.
    rest : PointTree or None
        Those rows. They are searched besides, so the answer is exact whatever the points; the
        input is never joggled.
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
        """Return the tessellation of finite (n, 3) points.

        Raises
        ------
        InvalidInput
            No point.
        """
        if len(points) == 0:
            raise InvalidInput("points must hold at least one point, got none")
        starts, neighbours = _edges(points)
        left_out = np.flatnonzero(np.diff(starts) == 0)
        entry = int(np.argmax(np.diff(starts)))
        rest = PointTree.from_points(points[left_out]) if len(left_out) else None
        return cls(read_only(points), starts, neighbours, entry, left_out, rest)

    def __len__(self) -> int:
        return len(self.points)

    def nearest(self, queries: Points, limit: float = np.inf) -> tuple[Labels, Vector]:
        """Return the row of the point nearest to each of (m, 3) queries, and the distance.

        Parameters
        ----------
        queries : (m, 3) [m]
            Fastest where queries that follow each other lie near each other.
        limit : float [m]
            Points this far away or farther do not count: the row is then -1 and the distance
            infinite.
        """
        queries = read_only(queries)
        rows, distances = nearest_vertices(
            self.points, self.starts, self.neighbours, queries, self.entry
        )
        if self.rest is not None:
            others, gaps = self.rest.nearest(queries)
            is_nearer = gaps < distances
            rows[is_nearer] = self.left_out[self.rest.rows[others[is_nearer]]]
            distances[is_nearer] = gaps[is_nearer]
        beyond = distances >= limit
        rows[beyond], distances[beyond] = -1, np.inf
        return rows, distances

    def __reduce__(self) -> tuple[Any, ...]:
        return Tessellation.from_points, (np.array(self.points),)


def _edges(points: Points) -> tuple[Labels, Labels]:
    """Return the edges of the tessellation by vertex; none where the points hold no volume."""
    from scipy.spatial import Delaunay, QhullError

    try:
        # About their middle, for Qhull lifts points by their squares and far from zero those
        # have no digits left.
        starts, neighbours = Delaunay(points - np.median(points, axis=0)).vertex_neighbor_vertices
    except (QhullError, ValueError):
        # Fewer than five points, or all in one plane.
        return np.zeros(len(points) + 1, np.int64), np.zeros(0, np.int64)
    return starts.astype(np.int64), neighbours.astype(np.int64)
