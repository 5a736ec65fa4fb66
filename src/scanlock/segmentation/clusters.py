"""Greedy clusters of polar bins: beta of Das et al. 2013, section V.

The paper grows a cluster from a random bin over the eight neighbours Theta as long as the test
Phi lets two bins combine. Each Phi here compares two bins and is symmetric, so what grows is a
connected component of the graph of combinable neighbours, whatever the seed and the order.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Labels, Mask, Matrix, Points, Vector, read_only
from scanlock.clouds.polar_grid import PolarGrid
from scanlock.errors import require_at_least, require_fraction, require_positive
from scanlock.kernels.ground.clusters import (
    close_pairs,
    joined_groups,
    occupied_cells,
    regrouped,
    touching_cells,
)
from scanlock.kernels.ground.splitting import cut_by_extent
from scanlock.kernels.points.moments import labelled_means
from scanlock.models.gaussians import Gaussians


@dataclass(frozen=True, eq=False)
class Bins:
    """Points in bins, none of them empty, and what a test may ask of the bins.

    Attributes
    ----------
    points : (n, 3) [m]
    labels : (n,)
        The bin of each point, -1 for none.
    count : int
        Number k of bins.
    """

    points: Points
    labels: Labels
    count: int

    @cached_property
    def means(self) -> Points:
        """The (k, 3) means [m]; much cheaper than all of the Gaussians."""
        _, means = labelled_means(read_only(self.points), read_only(self.labels), self.count)
        return read_only(means)

    @cached_property
    def gaussians(self) -> Gaussians:
        """The k Gaussians."""
        return Gaussians.from_labels(self.points, self.labels)


class MergeTest(Protocol):
    """Phi: whether the points of two bins can be combined."""

    def merges(self, bins: Bins, first: Labels, second: Labels) -> Mask:
        """Return (m,) whether the bins of the rows `first` combine with those of `second`."""
        ...


@dataclass(frozen=True, kw_only=True, slots=True)
class MeanDistance:
    """Phi by the Euclidean distance between the means of the two bins."""

    limit: float = 1.5
    """Bins combine when their means are closer than this [m]."""

    def __post_init__(self) -> None:
        require_positive("limit", self.limit, unit="m")

    def merges(self, bins: Bins, first: Labels, second: Labels) -> Mask:
        """Return (m,) whether the bins of the rows `first` combine with those of `second`."""
        return close_pairs(bins.means, read_only(first), read_only(second), float(self.limit))


@dataclass(frozen=True, kw_only=True, slots=True)
class L2Distance:
    """Phi by the L2 distance between the Gaussians of the two bins.

    The raw distance has the unit of a density, so one limit cannot fit bins of every size; the
    distance between the densities scaled to unit L2 norm is ``2 - 2 c`` with the correlation
    ``c = int f g / sqrt(int f^2 int g^2)`` in [0, 1].
    """

    least_correlation: float = 0.1
    """Bins combine when the correlation of their densities is above this."""

    min_deviation: float = 0.2
    """Least standard deviation of a bin [m]; flat bins would correlate with nothing."""

    def __post_init__(self) -> None:
        require_fraction("least_correlation", self.least_correlation)
        require_positive("deviation_floor", self.min_deviation, unit="m")

    def merges(self, bins: Bins, first: Labels, second: Labels) -> Mask:
        """Return (m,) whether the bins of the rows `first` combine with those of `second`."""
        regularised = bins.gaussians.regularised(self.min_deviation)
        a, b = regularised.taken(first), regularised.taken(second)
        both = a.covariances + b.covariances
        squared = _squared_mahalanobis(a.means - b.means, both)
        # N(0; 0, 2S) = 1 / sqrt(det(2 pi 2 S)): the factors of 2 pi cancel in the ratio.
        log_norms = 0.25 * (_log_det(2.0 * a.covariances) + _log_det(2.0 * b.covariances))
        return -0.5 * squared - 0.5 * _log_det(both) + log_norms > np.log(self.least_correlation)


@dataclass(frozen=True, kw_only=True, slots=True)
class GaussianFit:
    """Phi by how well one Gaussian fits the points of both bins.

    One Gaussian cannot stand for two heaps: if the means are farther apart than `limit`
    deviations of the scatter within the bins, along the direction between them, the union has
    a gap. A Gaussian cut in half measures 2.7, an even strip cut in half 3.5.
    """

    limit: float = 3.5
    """Largest distance of the means in pooled deviations."""

    min_deviation: float = 0.2
    """Least standard deviation of a bin [m]."""

    def __post_init__(self) -> None:
        require_positive("limit", self.limit)
        require_positive("deviation_floor", self.min_deviation, unit="m")

    def merges(self, bins: Bins, first: Labels, second: Labels) -> Mask:
        """Return (m,) whether the bins of the rows `first` combine with those of `second`."""
        a, b = bins.gaussians.taken(first), bins.gaussians.taken(second)
        share = (a.counts / (a.counts + b.counts))[:, None, None]
        pooled = Gaussians.from_covariances(
            a.means, share * a.covariances + (1.0 - share) * b.covariances, a.counts
        ).regularised(self.min_deviation)
        squared = _squared_mahalanobis(a.means - b.means, pooled.covariances)
        return squared < self.limit**2


@dataclass(frozen=True, kw_only=True, slots=True)
class ClusterFinder:
    """Settings of greedy clustering: bins, the test Phi, and what counts as a cluster."""

    grid: PolarGrid = field(default_factory=PolarGrid)
    """The polar grid of tau; points beyond its range belong to no cluster."""

    merge: MergeTest = field(default_factory=MeanDistance)
    """The test Phi."""

    max_radius: float = 3.0
    """A cluster with a point farther than this from its mean is cut [m].

    A wall would else become one Gaussian whose mean depends on how much of it was seen.
    """

    min_points: int = 6
    """Clusters of fewer points are dropped: they define no covariance."""

    def __post_init__(self) -> None:
        require_positive("largest_radius", self.max_radius, unit="m")
        require_at_least("min_points", self.min_points, 1)

    def label(self, points: Points) -> tuple[Labels, int]:
        """Return the cluster of each (n, 3) sensor-frame point, -1 for none, and their number.

        Clusters are numbered by their first bin: sector by sector, outwards.
        """
        labels, count = self.grow(points)
        labels, count = self.cut(points, labels, count, self.max_radius)
        return _without_small(labels, count, self.min_points)

    def grow(self, points: Points) -> tuple[Labels, int]:
        """Return the clusters as they grow, whatever their size and extent."""
        points = read_only(points)
        cells = self.grid.cells(points)
        bin_of_point, occupied = occupied_cells(cells, self.grid.sectors * self.grid.bins)
        bins = Bins(points, bin_of_point, len(occupied))
        # Theta: the eight bins around one.
        first, second = touching_cells(occupied, int(self.grid.sectors), self.grid.bins)
        joins = self.merge.merges(bins, first, second)
        cluster_of_bin, count = joined_groups(
            len(occupied), read_only(first), read_only(second), read_only(joins)
        )
        return regrouped(read_only(bin_of_point), read_only(cluster_of_bin)), count

    def cut(
        self, points: Points, labels: Labels, count: int, max_radius: float
    ) -> tuple[Labels, int]:
        """Return the clusters cut in two until none is larger than `max_radius` [m].

        Cutting to a large radius first and to a smaller one then gives the same clusters as
        cutting to the smaller one at once.
        """
        rows, runs, _ = _cut(points, labels, count, [max_radius], keeps_rows=True)
        order = np.argsort(runs[:, 1])
        cut = np.full(len(points), -1, np.int64)
        cut[rows] = np.repeat(order, (runs[:, 2] - runs[:, 1])[order])
        return cut, len(runs)

    def gaussians(
        self, points: Points, labels: Labels, count: int, radii: Sequence[float]
    ) -> list[Gaussians]:
        """Return the Gaussians of the clusters cut to each radius [m], which must not grow.

        Those of clusters as `cut` leaves them, but for those of fewer than `least_count` points.
        """
        _, runs, moments = _cut(points, labels, count, radii, keeps_rows=False)
        sizes = runs[:, 2] - runs[:, 1]
        kept = [
            np.flatnonzero((runs[:, 0] == scale) & (sizes >= self.min_points))
            for scale in range(len(radii))
        ]
        return [Gaussians(moments[k, :3], moments[k, 3:], sizes[k]) for k in kept]


def _cut(
    points: Points, labels: Labels, count: int, radii: Sequence[float], *, keeps_rows: bool
) -> tuple[Labels, Labels, Matrix]:
    scales = read_only(np.array(radii, np.float64))
    return cut_by_extent(read_only(points), read_only(labels), count, scales, keeps_rows)


def _without_small(labels: Labels, count: int, least_count: int) -> tuple[Labels, int]:
    sizes = np.bincount(labels[labels >= 0], minlength=count)
    kept = sizes >= least_count
    renumbered = np.append(np.where(kept, np.cumsum(kept) - 1, -1), -1)
    return renumbered[labels], int(kept.sum())


def _squared_mahalanobis(gaps: Points, covariances: NDArray[np.float64]) -> Vector:
    solved = np.linalg.solve(covariances, gaps[:, :, None])[:, :, 0]
    return np.einsum("mi,mi->m", gaps, solved)


def _log_det(covariances: NDArray[np.float64]) -> Vector:
    return np.linalg.slogdet(covariances)[1]
