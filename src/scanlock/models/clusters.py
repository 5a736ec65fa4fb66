"""Greedy clusters of polar bins: beta of Das et al. 2013, section V.

The paper grows a cluster from a random bin over the eight neighbours Theta as long as the test
Phi lets two bins combine. Each Phi here compares two bins and is symmetric, so what grows is a
connected component of the graph of combinable neighbours, whatever the seed and the order.
"""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from scanlock.arrays import Labels, Mask, Points, Vector, read_only
from scanlock.clouds.polar_grid import PolarGrid
from scanlock.errors import require_at_least, require_fraction, require_positive
from scanlock.kernels.grouping import occupied_cells, split_by_extent
from scanlock.models.gaussians import Gaussians


class MergeTest(Protocol):
    """Phi: whether the points of two bins can be combined."""

    def merges(self, first: Gaussians, second: Gaussians) -> Mask:
        """Return (m,) whether bin k of `first` combines with bin k of `second`."""
        ...


@dataclass(frozen=True, kw_only=True, slots=True)
class MeanDistance:
    """Phi by the Euclidean distance between the means of the two bins."""

    limit: float = 1.5
    """Bins combine when their means are closer than this [m]."""

    def __post_init__(self) -> None:
        require_positive("limit", self.limit, unit="m")

    def merges(self, first: Gaussians, second: Gaussians) -> Mask:
        """Return (m,) whether bin k of `first` combines with bin k of `second`."""
        gap = first.means - second.means
        return np.einsum("mi,mi->m", gap, gap) < self.limit**2


@dataclass(frozen=True, kw_only=True, slots=True)
class L2Distance:
    """Phi by the L2 distance between the Gaussians of the two bins.

    The raw distance has the unit of a density, so one limit cannot fit bins of every size; the
    distance between the densities scaled to unit L2 norm is ``2 - 2 c`` with the correlation
    ``c = int f g / sqrt(int f^2 int g^2)`` in [0, 1].
    """

    least_correlation: float = 0.1
    """Bins combine when the correlation of their densities is above this."""

    deviation_floor: float = 0.2
    """Least standard deviation of a bin [m]; flat bins would correlate with nothing."""

    def __post_init__(self) -> None:
        require_fraction("least_correlation", self.least_correlation)
        require_positive("deviation_floor", self.deviation_floor, unit="m")

    def merges(self, first: Gaussians, second: Gaussians) -> Mask:
        """Return (m,) whether bin k of `first` combines with bin k of `second`."""
        a, b = first.floored(self.deviation_floor), second.floored(self.deviation_floor)
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

    deviation_floor: float = 0.2
    """Least standard deviation of a bin [m]."""

    def __post_init__(self) -> None:
        require_positive("limit", self.limit)
        require_positive("deviation_floor", self.deviation_floor, unit="m")

    def merges(self, first: Gaussians, second: Gaussians) -> Mask:
        """Return (m,) whether bin k of `first` combines with bin k of `second`."""
        share = (first.counts / (first.counts + second.counts))[:, None, None]
        pooled = Gaussians(
            first.means,
            share * first.covariances + (1.0 - share) * second.covariances,
            first.counts,
        ).floored(self.deviation_floor)
        squared = _squared_mahalanobis(first.means - second.means, pooled.covariances)
        return squared < self.limit**2


@dataclass(frozen=True, kw_only=True, slots=True)
class ClusterFinder:
    """Settings of greedy clustering: bins, the test Phi, and what counts as a cluster."""

    grid: PolarGrid = field(default_factory=PolarGrid)
    """The polar grid of tau; points beyond its range belong to no cluster."""

    merge: MergeTest = field(default_factory=MeanDistance)
    """The test Phi."""

    largest_radius: float = 3.0
    """A cluster with a point farther than this from its mean is cut [m].

    A wall would else become one Gaussian whose mean depends on how much of it was seen.
    """

    least_count: int = 6
    """Clusters of fewer points are dropped: they define no covariance."""

    def __post_init__(self) -> None:
        require_positive("largest_radius", self.largest_radius, unit="m")
        require_at_least("least_count", self.least_count, 1)

    def label(self, points: Points) -> tuple[Labels, int]:
        """Return the cluster of each (n, 3) sensor-frame point, -1 for none, and their number.

        Clusters are numbered by their first bin: sector by sector, outwards.
        """
        labels, count = self.grow(points)
        labels, count = self.cut(points, labels, count, self.largest_radius)
        return _without_small(labels, count, self.least_count)

    def grow(self, points: Points) -> tuple[Labels, int]:
        """Return the clusters as they grow, whatever their size and extent."""
        points = read_only(points)
        cells = self.grid.cells(points)
        bin_of_point, occupied = occupied_cells(cells, self.grid.sectors * self.grid.bins)
        gaussians = Gaussians.from_labels(points, bin_of_point)
        cluster_of_bin = self._components(occupied, gaussians)
        # One more entry, so that the label -1 of a point without a bin stays -1.
        labels = np.append(cluster_of_bin, -1)[bin_of_point]
        return labels, int(cluster_of_bin.max(initial=-1)) + 1

    def cut(
        self, points: Points, labels: Labels, count: int, largest_radius: float
    ) -> tuple[Labels, int]:
        """Return the clusters cut in two until none is larger than `largest_radius` [m].

        Cutting to a large radius first and to a smaller one then gives the same clusters as
        cutting to the smaller one at once.
        """
        return split_by_extent(read_only(points), read_only(labels), count, largest_radius)

    def _components(self, occupied: Labels, gaussians: Gaussians) -> Labels:
        first, second = self._neighbours(occupied)
        merged = self.merge.merges(gaussians.taken(first), gaussians.taken(second))
        first, second = first[merged], second[merged]
        graph = coo_array(
            (np.ones(len(first), np.int8), (first, second)), shape=(len(occupied),) * 2
        )
        _, cluster_of_bin = connected_components(graph, directed=False)
        return cluster_of_bin.astype(np.int64)

    def _neighbours(self, occupied: Labels) -> tuple[Labels, Labels]:
        """Theta: each pair of occupied bins that touch, once; azimuth wraps, range does not."""
        sectors, bins = self.grid.sectors, self.grid.bins
        part_of_cell = np.full(sectors * bins, -1, dtype=np.int64)
        part_of_cell[occupied] = np.arange(len(occupied))
        sector, ring = np.divmod(occupied, bins)
        pairs: list[NDArray[np.int64]] = []
        for sector_step, ring_step in ((0, 1), (1, -1), (1, 0), (1, 1)):
            other_ring = ring + ring_step
            inside = np.flatnonzero((other_ring >= 0) & (other_ring < bins))
            cell = ((sector[inside] + sector_step) % sectors) * bins + other_ring[inside]
            found = part_of_cell[cell]
            pairs.append(np.stack([inside[found >= 0], found[found >= 0]]))
        first, second = np.concatenate(pairs, axis=1)
        return first, second


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
