"""Simulated annealing for initial poses outside the basin of convergence of ICP.

The combination that Madhavan and Messina 2003 leave to future work. A seeded search over a coarse
distance field proposes a few poses, ICP refines each of them, and the best result is kept.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from scanlock.arrays import Points, Vector
from scanlock.clouds.distance_field import DistanceField
from scanlock.clouds.point_cloud import PointCloud
from scanlock.clouds.voxel_grid import voxel_means
from scanlock.errors import require_count, require_fraction, require_positive
from scanlock.geometry.pose import Pose
from scanlock.optimisation.objectives.constraints import Constraints
from scanlock.optimisation.solvers.annealing import Annealing
from scanlock.optimisation.solvers.criteria import StopReason
from scanlock.optimisation.solvers.notes import LengthNote
from scanlock.optimisation.solvers.solution import Solution
from scanlock.registration.methods.icp.correspondences import PointScan
from scanlock.segmentation.segmentation import Segmenter, is_obstacle

_GROUND_VOXEL_SIZE = 1.0
"""Voxel size for downsampling the ground before it is sampled [m]. The ground is smooth."""


@dataclass(frozen=True, kw_only=True, slots=True)
class AnnealedStart:
    """Settings of the search for initial poses."""

    annealing: Annealing = field(default_factory=Annealing)
    """Simulated annealing."""

    sample_size: int = 500
    """Number of source points that are evaluated at each pose."""

    ground_ratio: float = 0.3
    """Ratio of them on the ground, which constrains height, roll and pitch. Obstacles constrain the
    other directions."""

    cell_size: float = 0.5
    """Cell size of the distance field, and voxel size for downsampling the obstacles [m]."""

    max_distance: float = 5.0
    """Upper bound of all distances [m], beyond which the distance field has no gradient."""

    inlier_ratio: float = 0.8
    """Ratio of the points that enter the trimmed mean distance, the closest ones. The others may be
    occluded in the target."""

    min_improvement: float = 0.01
    """Minimum relative reduction of the trimmed mean distance for which the result from another
    start replaces that from the initial pose. Fixed points of ICP lie centimetres apart and differ
    by less, at random."""

    seed: int = 0
    """Seed of the sampling of points."""

    def __post_init__(self) -> None:
        require_count("sample_size", self.sample_size)
        require_fraction("ground_ratio", self.ground_ratio)
        require_positive("cell_size", self.cell_size, unit="m")
        require_positive("max_distance", self.max_distance, unit="m")
        require_positive("inlier_ratio", self.inlier_ratio)
        require_fraction("inlier_ratio", self.inlier_ratio)
        require_fraction("min_improvement", self.min_improvement)
        require_count("seed", self.seed, 0)

    def sample(self, cloud: PointCloud) -> Points:
        """Return (k, 3) random points of a scan [m], of obstacles and of the ground."""
        ground = Segmenter().ground.find(cloud)
        obstacles = _downsampled(cloud.points[is_obstacle(cloud, ground)], self.cell_size)
        level = _downsampled(cloud.points[ground.is_ground], _GROUND_VOXEL_SIZE)
        rng = np.random.default_rng(self.seed)
        count = min(len(obstacles), self.sample_size - round(self.ground_ratio * self.sample_size))
        chosen = rng.choice(obstacles, count, replace=False)
        others = rng.choice(level, min(len(level), self.sample_size - count), replace=False)
        return np.concatenate([chosen, others])

    def starts(
        self, target: PointScan, source: PointScan, start: Pose, constraints: Constraints
    ) -> tuple[Pose, ...]:
        """Return the initial pose, followed by the poses that the search found."""
        if not len(source.sample):
            return (start,)
        distances = DistanceField.from_points(target.points, self.cell_size, self.max_distance)

        def energy(pose: Pose) -> float:
            return self._trimmed_mean(distances.at(pose.apply(source.sample)))

        found = self.annealing.search(energy, start, constraints.free_directions)
        return (start, *(minimum.pose for minimum in found))

    def best(self, target: PointScan, source: PointScan, solutions: Sequence[Solution]) -> Solution:
        """Return the solution with the smallest trimmed distance, with a note.

        That of the initial pose, which is the first, is kept unless another is smaller by more than
        `min_improvement`. It is also returned if no solution has correspondences.
        """
        usable = [one for one in solutions if one.reason is not StopReason.EMPTY_OBJECTIVE]
        if not usable:
            return solutions[0]
        distances = [self.trimmed_distance(target, source, one.pose) for one in usable]
        best = int(np.argmin(distances))
        min_reduced = (1.0 - self.min_improvement) * distances[0]
        if usable[0] is solutions[0] and distances[best] >= min_reduced:
            best = 0
        note = LengthNote(
            f"annealing proposed {len(solutions) - 1} starts; trimmed mean distance {{:.3g}} m",
            (distances[best],),
        )
        return replace(usable[best], notes=(*usable[best].notes, note))

    def trimmed_distance(self, target: PointScan, source: PointScan, pose: Pose) -> float:
        """Return the trimmed mean distance of the source's points to the target [m].

        Exact distances rather than those of the field, to compare results that differ by little.
        """
        _, distances = target.closest.nearest(pose.apply(source.points), self.max_distance)
        return self._trimmed_mean(np.minimum(distances, self.max_distance))

    def _trimmed_mean(self, distances: Vector) -> float:
        count = max(1, round(self.inlier_ratio * len(distances)))
        return float(np.partition(distances, count - 1)[:count].mean())


def _downsampled(points: Points, voxel_size: float) -> Points:
    return voxel_means(points, voxel_size) if len(points) else points
