"""Partition of points into a given number of parts by k-means."""

from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Labels, Points, read_only
from scanlock.clouds.point_tree import PointTree
from scanlock.errors import require_count
from scanlock.kernels.points.k_means import spread_seeds
from scanlock.kernels.points.moments import labelled_moments


@dataclass(frozen=True, kw_only=True, slots=True)
class KMeans:
    """Settings of Lloyd's algorithm from k-means++ seeds."""

    seed: int = 0
    """Of the random numbers that choose the first centres: the same seed, the same parts."""

    max_iterations: int = 100
    """Rounds at most; it ends sooner when no point changes its part."""

    def __post_init__(self) -> None:
        require_count("seed", self.seed, 0)
        require_count("max_iterations", self.max_iterations)

    def labels(self, points: Points, count: int) -> Labels:
        """Return the part of each (n, 3) point, from 0 to below `count`; a part may be empty.

        Equal to the same rows in another order only where the rows themselves are; sort them
        first where that matters.
        """
        require_count("count", count)
        if len(points) == 0:
            return np.empty(0, np.int64)
        given = read_only(points)
        draws = np.random.default_rng(self.seed).random(min(count, len(points)))
        centres = given[spread_seeds(given, read_only(draws))]
        labels = np.full(len(points), -1, np.int64)
        for _ in range(self.max_iterations):
            tree = PointTree.from_points(centres)
            nearest = tree.rows[tree.nearest(given)[0]]
            if np.array_equal(nearest, labels):
                break
            labels = nearest
            counts, means, _ = labelled_moments(given, read_only(labels), len(centres))
            # A centre that lost its last point stays: it may win others back.
            centres = np.where(counts[:, None] > 0, means, centres)
        return labels
