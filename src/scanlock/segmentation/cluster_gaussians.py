"""What registration keeps of one scan: lines 1 to 5 of Algorithm 1 of Das et al. 2013."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from scanlock.arrays import Points, frozen
from scanlock.clouds.point_cloud import PointCloud
from scanlock.clouds.voxel_grid import voxel_labels
from scanlock.errors import require_at_least, require_positive
from scanlock.models.gaussians import Gaussians
from scanlock.segmentation.ground.finder import Ground, GroundStatus
from scanlock.segmentation.segmentation import Segmenter, obstacle_points, upright
from scanlock.timing import StageClock

MIN_GAUSSIANS = 4
"""Three Gaussians can be laid over three others by chance; four hardly ever."""


@dataclass(frozen=True, slots=True, eq=False)
class ClusterGaussians:
    """A scan ready to be registered, as target or as source.

    Attributes
    ----------
    cloud : PointCloud
        The checked points of the whole scan.
    obstacles : (n, 3) [m]
        The points above the ground; all points where there is no ground.
    gaussians : tuple of Gaussians
        One set for each scale, coarsest first: clusters, or voxels where there is no ground.
    notes : tuple of str
        What was found on the way.
    """

    cloud: PointCloud
    obstacles: Points
    gaussians: tuple[Gaussians, ...]
    notes: tuple[str, ...]

    def __post_init__(self) -> None:
        frozen(self.obstacles)

    @property
    def insufficient(self) -> str:
        """Why the scan cannot be registered; empty when it can."""
        parts = len(self.gaussians[-1])
        if parts >= MIN_GAUSSIANS:
            return ""
        return f"has {parts} Gaussians above the ground; {MIN_GAUSSIANS} are needed"


@dataclass(frozen=True, kw_only=True, slots=True)
class ClusterGaussianExtractor:
    """Settings of the front end: a scan's ground removed, the rest as Gaussians."""

    segmenter: Segmenter = field(default_factory=Segmenter)
    """Ground and clusters; the scales of the registration decide how fine clusters are cut."""

    min_deviation: float = 0.1
    """Least standard deviation of a Gaussian along any axis [m]: noise, and the jitter of a
    cluster's mean between two views."""

    def __post_init__(self) -> None:
        require_positive("deviation_floor", self.min_deviation, unit="m")
        require_at_least("least_count", self.segmenter.clusters.min_points, 2)

    def find(
        self, cloud: PointCloud, radii: Sequence[float], clock: StageClock | None = None
    ) -> ClusterGaussians:
        """Return the landmarks of a cloud in its sensor's frame.

        Parameters
        ----------
        cloud : PointCloud
        radii : sequence of float [m]
            Maximum radius of a cluster at each scale, not growing.
        clock : StageClock, optional
            Adds up the wall time of each stage.
        """
        clock = clock or StageClock()
        with clock.stage("ground"):
            ground = self.segmenter.ground.find(cloud)
        return self.find_above(cloud, ground, radii, clock)

    def find_above(
        self,
        cloud: PointCloud,
        ground: Ground,
        radii: Sequence[float],
        clock: StageClock | None = None,
    ) -> ClusterGaussians:
        """Return the landmarks of a cloud whose ground is known; see `find`."""
        clock = clock or StageClock()
        with clock.stage("obstacles"):
            obstacles = obstacle_points(cloud, ground)
        distinct = sorted(set(radii), reverse=True)
        with clock.stage("clusters"):
            found = self._gaussians(obstacles, ground, distinct)
            gaussians = {
                radius: one.regularised(self.min_deviation)
                for radius, one in zip(distinct, found, strict=True)
            }
        scales = tuple(gaussians[radius] for radius in radii)
        note = f"ground {ground.status.value}: {ground.reason}; {len(scales[-1])} Gaussians"
        return ClusterGaussians(cloud, obstacles, scales, (note,))

    def _gaussians(
        self, obstacles: Points, ground: Ground, radii: Sequence[float]
    ) -> list[Gaussians]:
        finder = self.segmenter.clusters
        if ground.status is GroundStatus.NONE:
            # Nothing separates the columns of polar bins; cubes take the place of clusters.
            partitions = [voxel_labels(obstacles, radius)[0] for radius in radii]
            return [Gaussians.from_labels(obstacles, one, finder.min_points) for one in partitions]
        labels, count = finder.grow(upright(obstacles, ground))
        return finder.gaussians(obstacles, labels, count, radii)
