"""Greedy clustering of polar bins: beta of Das et al. 2013, section V.

The paper grows a cluster from a random bin over the eight neighbours Theta as long as the test
Phi allows two bins to combine. Each test here compares two bins and is symmetric. A cluster is
therefore a connected component of the graph of bins, independent of the seed and the order.
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
    adjacent_cells,
    are_close,
    connected_components,
    occupied_cells,
    relabelled,
)
from scanlock.kernels.ground.splitting import split_by_extent
from scanlock.kernels.points.moments import labelled_means
from scanlock.models.gaussians import Gaussians


@dataclass(frozen=True, eq=False)
class BinnedPoints:
    """Points grouped into non-empty bins, with the statistics that merge tests compare.

    Attributes
    ----------
    points : (n, 3) [m]
        Points.
    labels : (n,)
        Bin of each point, -1 for none.
    count : int
        Number k of bins.
    """

    points: Points
    labels: Labels
    count: int

    @cached_property
    def means(self) -> Points:
        """The (k, 3) means of the bins [m]; much cheaper than `gaussians`."""
        _, means = labelled_means(read_only(self.points), read_only(self.labels), self.count)
        return read_only(means)

    @cached_property
    def gaussians(self) -> Gaussians:
        """The k Gaussians of the bins."""
        return Gaussians.from_labels(self.points, self.labels)


class MergeTest(Protocol):
    """Test Phi: whether the points of two bins are combined."""

    def merges(self, bins: BinnedPoints, first: Labels, second: Labels) -> Mask:
        """Return (m,) whether bin ``first[i]`` combines with bin ``second[i]``."""
        ...


@dataclass(frozen=True, kw_only=True, slots=True)
class MeanDistance:
    """Test Phi by the Euclidean distance between the means of two bins."""

    max_distance: float = 1.5
    """Distance between means below which bins combine [m]."""

    def __post_init__(self) -> None:
        require_positive("max_distance", self.max_distance, unit="m")

    def merges(self, bins: BinnedPoints, first: Labels, second: Labels) -> Mask:
        """Return (m,) whether bin ``first[i]`` combines with bin ``second[i]``."""
        limit = float(self.max_distance)
        return are_close(bins.means, read_only(first), read_only(second), limit)


@dataclass(frozen=True, kw_only=True, slots=True)
class L2Distance:
    """Test Phi by the L2 distance between the Gaussians of two bins.

    The plain distance has the unit of a density, so no single threshold suits bins of all sizes.
    Between densities of unit L2 norm it is ``2 - 2 c`` with the correlation
    ``c = int f g / sqrt(int f^2 int g^2)`` in [0, 1].
    """

    min_correlation: float = 0.1
    """Correlation of the densities above which bins combine."""

    min_deviation: float = 0.2
    """Minimum standard deviation of a bin [m]; flat bins would correlate with no other."""

    def __post_init__(self) -> None:
        require_fraction("min_correlation", self.min_correlation)
        require_positive("min_deviation", self.min_deviation, unit="m")

    def merges(self, bins: BinnedPoints, first: Labels, second: Labels) -> Mask:
        """Return (m,) whether bin ``first[i]`` combines with bin ``second[i]``."""
        regularised = bins.gaussians.regularised(self.min_deviation)
        a, b = regularised.taken(first), regularised.taken(second)
        both = a.covariances + b.covariances
        squared = _squared_mahalanobis(a.means - b.means, both)
        # N(0; 0, 2S) = 1 / sqrt(det(2 pi 2 S)): the factors of 2 pi cancel in the ratio.
        log_norms = 0.25 * (_log_det(2.0 * a.covariances) + _log_det(2.0 * b.covariances))
        return -0.5 * squared - 0.5 * _log_det(both) + log_norms > np.log(self.min_correlation)


@dataclass(frozen=True, kw_only=True, slots=True)
class GaussianFit:
    """Test Phi by the fit of one Gaussian to the points of two bins.

    The test compares the Mahalanobis distance of the means, with the pooled covariance of the
    bins, to a threshold. Two halves of a Gaussian have a distance of 2.7, two halves of a uniform
    strip 3.5; a larger distance means a gap between the bins.
    """

    max_mahalanobis: float = 3.5
    """Mahalanobis distance of the means below which bins combine."""

    min_deviation: float = 0.2
    """Minimum standard deviation of the pooled covariance [m]."""

    def __post_init__(self) -> None:
        require_positive("max_mahalanobis", self.max_mahalanobis)
        require_positive("min_deviation", self.min_deviation, unit="m")

    def merges(self, bins: BinnedPoints, first: Labels, second: Labels) -> Mask:
        """Return (m,) whether bin ``first[i]`` combines with bin ``second[i]``."""
        a, b = bins.gaussians.taken(first), bins.gaussians.taken(second)
        fraction = (a.counts / (a.counts + b.counts))[:, None, None]
        pooled = Gaussians.from_covariances(
            a.means, fraction * a.covariances + (1.0 - fraction) * b.covariances, a.counts
        ).regularised(self.min_deviation)
        squared = _squared_mahalanobis(a.means - b.means, pooled.covariances)
        return squared < self.max_mahalanobis**2


@dataclass(frozen=True, kw_only=True, slots=True)
class ClusterFinder:
    """Settings of greedy clustering: the bins, the merge test and the size of clusters."""

    grid: PolarGrid = field(default_factory=PolarGrid)
    """Polar grid tau; points outside its range belong to no cluster."""

    merge: MergeTest = field(default_factory=MeanDistance)
    """Merge test Phi."""

    max_radius: float = 3.0
    """Largest distance of a point from the mean of its cluster [m]; larger clusters are split.

    The mean of an unsplit wall would depend on its visible extent.
    """

    min_points: int = 6
    """Minimum number of points of a cluster; smaller ones are dropped."""

    def __post_init__(self) -> None:
        require_positive("max_radius", self.max_radius, unit="m")
        require_at_least("min_points", self.min_points, 1)

    def label(self, points: Points) -> tuple[Labels, int]:
        """Cluster points in the sensor frame.

        Parameters
        ----------
        points : (n, 3) [m]
            Points without ground.

        Returns
        -------
        labels : (n,)
            Cluster of each point, -1 for none. Clusters are numbered by their first bin: by
            sector, then by range.
        count : int
            Number of clusters.
        """
        labels, count = self.grow(points)
        labels, count = self.split(points, labels, count, self.max_radius)
        return _without_small(labels, count, self.min_points)

    def grow(self, points: Points) -> tuple[Labels, int]:
        """Return the connected clusters of any size; parameters and results are as for `label`."""
        points = read_only(points)
        cells = self.grid.cells(points)
        bin_of_point, occupied = occupied_cells(cells, self.grid.sectors * self.grid.bins)
        bins = BinnedPoints(points, bin_of_point, len(occupied))
        # Theta: the eight neighbours of a bin.
        first, second = adjacent_cells(occupied, int(self.grid.sectors), self.grid.bins)
        joins = self.merge.merges(bins, first, second)
        cluster_of_bin, count = connected_components(
            len(occupied), read_only(first), read_only(second), read_only(joins)
        )
        return relabelled(read_only(bin_of_point), read_only(cluster_of_bin)), count

    def split(
        self, points: Points, labels: Labels, count: int, max_radius: float
    ) -> tuple[Labels, int]:
        """Split clusters in two until none is larger than `max_radius` [m].

        Splits are nested: splitting to a large radius and then to a smaller one gives the clusters
        of splitting to the smaller one.

        Parameters
        ----------
        points : (n, 3) [m]
            Points.
        labels : (n,)
            Cluster of each point, -1 for none.
        count : int
            Number of clusters.
        max_radius : float [m]
            Largest distance of a point from the mean of its cluster.

        Returns
        -------
        labels, count
            As given, after the splits.
        """
        rows, runs, _ = _split(points, labels, count, [max_radius], keeps_rows=True)
        order = np.argsort(runs[:, 1])
        split = np.full(len(points), -1, np.int64)
        split[rows] = np.repeat(order, (runs[:, 2] - runs[:, 1])[order])
        return split, len(runs)

    def gaussians(
        self, points: Points, labels: Labels, count: int, radii: Sequence[float]
    ) -> list[Gaussians]:
        """Return the Gaussians of the clusters after `split` to each radius.

        Parameters
        ----------
        points, labels, count
            As for `split`.
        radii : sequence of float [m]
            Largest cluster radii, in descending order.

        Returns
        -------
        list of Gaussians
            One set for each radius, without clusters of fewer than `min_points` points.
        """
        _, runs, moments = _split(points, labels, count, radii, keeps_rows=False)
        sizes = runs[:, 2] - runs[:, 1]
        rows = [
            np.flatnonzero((runs[:, 0] == scale) & (sizes >= self.min_points))
            for scale in range(len(radii))
        ]
        return [Gaussians(moments[k, :3], moments[k, 3:], sizes[k]) for k in rows]


def _split(
    points: Points, labels: Labels, count: int, radii: Sequence[float], *, keeps_rows: bool
) -> tuple[Labels, Labels, Matrix]:
    scales = read_only(np.array(radii, np.float64))
    return split_by_extent(read_only(points), read_only(labels), count, scales, keeps_rows)


def _without_small(labels: Labels, count: int, min_points: int) -> tuple[Labels, int]:
    sizes = np.bincount(labels[labels >= 0], minlength=count)
    is_large = sizes >= min_points
    renumbered = np.append(np.where(is_large, np.cumsum(is_large) - 1, -1), -1)
    return renumbered[labels], int(is_large.sum())


def _squared_mahalanobis(differences: Points, covariances: NDArray[np.float64]) -> Vector:
    solved = np.linalg.solve(covariances, differences[:, :, None])[:, :, 0]
    return np.einsum("mi,mi->m", differences, solved)


def _log_det(covariances: NDArray[np.float64]) -> Vector:
    return np.linalg.slogdet(covariances)[1]
