"""Simulated annealing in front of ICP, for starts beyond its basin.

The hybrid that Madhavan and Messina 2003 leave to later work: a seeded search over a coarse map of
distances finds the few poses worth a descent, ICP descends from each, and the best is kept.
"""

from dataclasses import dataclass, field

import numpy as np

from scanlock.arrays import Points, Vector
from scanlock.clouds.distance_field import DistanceField
from scanlock.clouds.point_cloud import PointCloud
from scanlock.clouds.voxel_grid import voxel_means
from scanlock.errors import require_count, require_fraction, require_positive
from scanlock.geometry.pose import Pose
from scanlock.optimisation.objectives.constraints import Constraints
from scanlock.optimisation.solvers.annealing import Annealing
from scanlock.registration.methods.correspondences import PointScan
from scanlock.segmentation.segmentation import Segmenter, is_obstacle

_GROUND_WIDTH = 1.0
"""Ground is thinned to voxels of this side before it is sampled [m]: it is smooth."""


@dataclass(frozen=True, kw_only=True, slots=True)
class AnnealedStart:
    """Settings of the search for starts."""

    annealing: Annealing = field(default_factory=Annealing)
    """The search itself."""

    sample_size: int = 500
    """Points of the source that are looked up at each pose."""

    ground_ratio: float = 0.3
    """Share of them on the ground, which holds height and tilt; what stands holds the rest."""

    cell_size: float = 0.5
    """Side of the cubes of the distance field, and of the voxels that standing points are thinned
    to [m]."""

    max_distance: float = 5.0
    """Distances count no more than this [m]; it is also how far the field draws a point."""

    inlier_ratio: float = 0.8
    """Share of the points whose distances count, the smallest: the rest may be hidden."""

    min_improvement: float = 0.01
    """The descent from the initial pose is kept unless another ends with a trimmed distance
    smaller by more than this share of it. Fixed points of ICP lie centimetres apart, as good as
    each other, and chance would decide between them."""

    seed: int = 0
    """Decides which points are sampled."""

    def __post_init__(self) -> None:
        require_count("sample_size", self.sample_size)
        require_fraction("ground_ratio", self.ground_ratio)
        require_positive("cell_size", self.cell_size, unit="m")
        require_positive("max_distance", self.max_distance, unit="m")
        require_positive("inlier_ratio", self.inlier_ratio)
        require_fraction("inlier_ratio", self.inlier_ratio)
        require_fraction("min_improvement", self.min_improvement)
        require_count("seed", self.seed, 0)

    def sampled(self, cloud: PointCloud) -> Points:
        """Return (k, 3) points of a scan to look up: mostly what stands on its ground."""
        ground = Segmenter().ground.find(cloud)
        standing = _thinned(cloud.points[is_obstacle(cloud, ground)], self.cell_size)
        level = _thinned(cloud.points[ground.is_ground], _GROUND_WIDTH)
        rng = np.random.default_rng(self.seed)
        count = min(len(standing), self.sample_size - round(self.ground_ratio * self.sample_size))
        chosen = rng.choice(standing, count, replace=False)
        others = rng.choice(level, min(len(level), self.sample_size - count), replace=False)
        return np.concatenate([chosen, others])

    def poses(
        self, target: PointScan, source: PointScan, start: Pose, constraints: Constraints
    ) -> tuple[Pose, ...]:
        """Return the start and the poses that the search found, to descend from each."""
        if not len(source.sample):
            return (start,)
        distances = DistanceField.from_points(target.points, self.cell_size, self.max_distance)

        def energy(pose: Pose) -> float:
            return self._trimmed_mean(distances.at(pose.apply(source.sample)))

        found = self.annealing.search(energy, start, constraints.free_directions)
        return (start, *(minimum.pose for minimum in found))

    def trimmed_distance(self, target: PointScan, source: PointScan, pose: Pose) -> float:
        """Return the mean distance of the closest share of the source's points to the target [m].

        To the points themselves, not by the field: fine enough to choose between results.
        """
        _, distances = target.closest.nearest(pose.apply(source.points), self.max_distance)
        return self._trimmed_mean(np.minimum(distances, self.max_distance))

    def _trimmed_mean(self, distances: Vector) -> float:
        count = max(1, round(self.inlier_ratio * len(distances)))
        return float(np.partition(distances, count - 1)[:count].mean())


def _thinned(points: Points, width: float) -> Points:
    return voxel_means(points, width) if len(points) else points
