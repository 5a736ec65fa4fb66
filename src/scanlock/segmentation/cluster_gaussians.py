"""Gaussians of the clusters of one scan: Algorithm 1, lines 1 to 5, of Das et al. 2013."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from scanlock.arrays import Points, frozen, short_repr
from scanlock.clouds.point_cloud import PointCloud
from scanlock.clouds.voxel_grid import voxel_labels
from scanlock.errors import require_at_least, require_count, require_positive
from scanlock.models.gaussians import Gaussians
from scanlock.segmentation.ground.finder import Ground, GroundFinder, GroundStatus
from scanlock.segmentation.segmentation import Segmenter, obstacle_points, upright
from scanlock.timing import StageClock

MIN_GAUSSIANS = 4
"""Minimum number of Gaussians for a registration: any three can be aligned with three others by
chance, four hardly ever."""


@dataclass(frozen=True, slots=True, eq=False)
class ClusterGaussians:
    """The clusters of a scan as Gaussians, at several scales.

    Attributes
    ----------
    cloud : PointCloud
        Checked points of the whole scan.
    ground : Ground
        Ground of the scan.
    obstacles : (n, 3) [m]
        Points above the ground; all measured points if there is no ground.
    gaussians : tuple of Gaussians
        One set per scale, coarsest first: clusters, or voxels if there is no ground.
    notes : tuple of str
        Facts for the notes of the result.
    """

    cloud: PointCloud
    ground: Ground
    obstacles: Points
    gaussians: tuple[Gaussians, ...]
    notes: tuple[str, ...]

    __repr__ = short_repr

    def __post_init__(self) -> None:
        frozen(self.obstacles)

    @property
    def insufficient_reason(self) -> str:
        """Why the scan cannot be registered; empty if it can."""
        count = len(self.gaussians[-1])
        if count >= MIN_GAUSSIANS:
            return ""
        return f"has {count} Gaussians above the ground; {MIN_GAUSSIANS} are needed"


@dataclass(frozen=True, kw_only=True, slots=True)
class ClusterGaussianExtractor:
    """Settings of the extraction: remove the ground, cluster the rest, fit a Gaussian to each."""

    segmenter: Segmenter = field(
        default_factory=lambda: Segmenter(ground=GroundFinder(max_tilt=math.pi))
    )
    """Ground and cluster finder. Its maximum cluster radius is not used: each scale has its own.

    The ground may have any tilt. A wall instead of it is as good for the search, if both scans
    take the same one.
    """

    min_deviation: float = 0.1
    """Minimum standard deviation of a Gaussian along any axis [m]. It covers sensor noise and the
    variation of a cluster's mean between two views."""

    max_gaussians: int = 20_000
    """Maximum number of Gaussians of a scale, those of the most points first. A scan has up to
    2200, a square kilometre of forest about 25,000."""

    def __post_init__(self) -> None:
        require_count("max_gaussians", self.max_gaussians, MIN_GAUSSIANS)
        require_positive("min_deviation", self.min_deviation, unit="m")
        require_at_least("segmenter.clusters.min_points", self.segmenter.clusters.min_points, 2)

    def extract(
        self, cloud: PointCloud, radii: Sequence[float], clock: StageClock | None = None
    ) -> ClusterGaussians:
        """Extract the cluster Gaussians of a cloud in its sensor's frame.

        Parameters
        ----------
        cloud : PointCloud
        radii : sequence of float [m]
            Maximum cluster radius of each scale, not increasing.
        clock : StageClock, optional
            Adds up the wall time of each stage.
        """
        clock = clock or StageClock()
        with clock.stage("ground"):
            ground = self.segmenter.ground.find(cloud)
        return self.extract_above(cloud, ground, radii, clock)

    def extract_above(
        self,
        cloud: PointCloud,
        ground: Ground,
        radii: Sequence[float],
        clock: StageClock | None = None,
    ) -> ClusterGaussians:
        """Extract the cluster Gaussians of a cloud with known ground; see `extract`."""
        clock = clock or StageClock()
        with clock.stage("obstacles"):
            obstacles = obstacle_points(cloud, ground)
        distinct_radii = sorted(set(radii), reverse=True)
        with clock.stage("clusters"):
            sets = self._gaussians(obstacles, ground, distinct_radii)
            of_radius = {
                radius: gaussians.with_most_points(self.max_gaussians).regularised(
                    self.min_deviation
                )
                for radius, gaussians in zip(distinct_radii, sets, strict=True)
            }
        scales = tuple(of_radius[radius] for radius in radii)
        note = f"ground {ground.status.value}: {ground.reason}; {len(scales[-1])} Gaussians"
        return ClusterGaussians(
            cloud=cloud, ground=ground, obstacles=obstacles, gaussians=scales, notes=(note,)
        )

    def _gaussians(
        self, obstacles: Points, ground: Ground, radii: Sequence[float]
    ) -> list[Gaussians]:
        """Return the Gaussians of the clusters cut to each radius, or of voxels without ground."""
        finder = self.segmenter.clusters
        if ground.status is GroundStatus.NONE:
            # Polar bins would mix floor, furniture and ceiling.
            partitions = [voxel_labels(obstacles, radius)[0] for radius in radii]
            return [Gaussians.from_labels(obstacles, one, finder.min_points) for one in partitions]
        labels, count = finder.grow(upright(obstacles, ground))
        return finder.gaussians(obstacles, labels, count, radii)
