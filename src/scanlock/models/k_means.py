"""k-means clustering of points."""

from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Labels, Points, read_only
from scanlock.clouds.point_tree import PointTree
from scanlock.errors import require_count
from scanlock.kernels.points.k_means import kmeans_plusplus
from scanlock.kernels.points.moments import labelled_moments


@dataclass(frozen=True, kw_only=True, slots=True)
class KMeans:
    """Settings of Lloyd's algorithm with k-means++ initialisation."""

    seed: int = 0
    """Seed of the random numbers that choose the initial centres."""

    max_iterations: int = 100
    """Maximum number of iterations; it stops earlier when no assignment changes."""

    def __post_init__(self) -> None:
        require_count("seed", self.seed, 0)
        require_count("max_iterations", self.max_iterations)

    def labels(self, points: Points, count: int) -> Labels:
        """Assign points to clusters.

        Parameters
        ----------
        points : (n, 3) [m]
            Points; their order matters, so sort them where the result must not depend on it.
        count : int
            Number of clusters.

        Returns
        -------
        (n,)
            Cluster of each point, from 0 to ``count - 1``; a cluster may be empty.

        Raises
        ------
        InvalidInput
            `count` is not a whole number of at least 1.
        """
        require_count("count", count)
        if len(points) == 0:
            return np.empty(0, np.int64)
        points = read_only(points)
        draws = np.random.default_rng(self.seed).random(min(count, len(points)))
        centres = points[kmeans_plusplus(points, read_only(draws))]
        labels = np.full(len(points), -1, np.int64)
        for _ in range(self.max_iterations):
            tree = PointTree.from_points(centres)
            nearest = tree.rows[tree.nearest(points)[0]]
            if np.array_equal(nearest, labels):
                break
            labels = nearest
            counts, means, _ = labelled_moments(points, read_only(labels), len(centres))
            # An empty cluster keeps its centre, and may gain points again.
            centres = np.where(counts[:, None] > 0, means, centres)
        return labels
