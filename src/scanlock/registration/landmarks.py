"""What registration keeps of one scan: lines 1 to 5 of Algorithm 1 of Das et al. 2013."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from scanlock.arrays import Labels, Points, frozen
from scanlock.clouds.point_cloud import PointCloud
from scanlock.clouds.voxel_grid import voxel_labels, voxel_means
from scanlock.errors import require_at_least, require_positive
from scanlock.models.gaussians import Gaussians
from scanlock.models.ground import Ground, GroundStatus
from scanlock.models.segmentation import Segmenter, upright
from scanlock.registration.stages import StageClock


@dataclass(frozen=True, slots=True, eq=False)
class Landmarks:
    """A scan ready to be registered, as target or as source.

    Attributes
    ----------
    cloud : PointCloud
        The checked points of the whole scan.
    obstacles : (n, 3) [m]
        The points that are not ground (all where there is none), thinned to one a voxel.
    gaussians : Gaussians
        One for each cluster, or for each voxel where there is no ground.
    notes : tuple of str
        What was found on the way.
    timings : mapping of str to float [s]
        Wall time of each stage.
    """

    cloud: PointCloud
    obstacles: Points
    gaussians: Gaussians
    notes: tuple[str, ...]
    timings: Mapping[str, float]

    def __post_init__(self) -> None:
        frozen(self.obstacles)


@dataclass(frozen=True, kw_only=True, slots=True)
class LandmarkFinder:
    """Settings of the front end: a scan's ground removed, the rest as Gaussians."""

    segmenter: Segmenter = field(default_factory=Segmenter)
    """Ground and clusters."""

    deviation_floor: float = 0.1
    """Least standard deviation of a Gaussian along any axis [m]: noise, and the jitter of a
    cluster's mean between two views."""

    voxel_width: float = 3.0
    """Side of the voxels that stand in for clusters where no ground separates them [m]."""

    spacing: float = 0.5
    """Side of the voxels that thin the obstacle points for P2D [m]."""

    least_count: int = 6
    """Voxels of fewer points are dropped: they define no covariance."""

    def __post_init__(self) -> None:
        require_positive("deviation_floor", self.deviation_floor, unit="m")
        require_positive("voxel_width", self.voxel_width, unit="m")
        require_positive("spacing", self.spacing, unit="m")
        require_at_least("least_count", self.least_count, 1)

    def find(self, cloud: PointCloud) -> Landmarks:
        """Return the landmarks of a cloud in its sensor's frame."""
        clock = StageClock()
        with clock.stage("ground"):
            ground = self.segmenter.ground.find(cloud)
            obstacles = np.ascontiguousarray(cloud.points[~ground.is_ground])
        with clock.stage("clusters"):
            labels = self._parts(obstacles, ground)
        with clock.stage("gaussians"):
            gaussians = Gaussians.from_labels(obstacles, labels, self.least_count)
            gaussians = gaussians.floored(self.deviation_floor)
            thinned = voxel_means(obstacles, self.spacing)
        notes = (f"ground {ground.status.value}: {ground.reason}",)
        return Landmarks(cloud, thinned, gaussians, notes, clock.seconds)

    def _parts(self, obstacles: Points, ground: Ground) -> Labels:
        if ground.status is GroundStatus.NONE:
            # Nothing separates the columns of a polar bin here, so cubes do.
            return voxel_labels(obstacles, self.voxel_width)[0]
        return self.segmenter.clusters.label(upright(obstacles, ground))[0]
