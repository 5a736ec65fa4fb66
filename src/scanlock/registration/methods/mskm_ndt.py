"""Multi-scale k-means NDT in three dimensions: Das and Waslander 2012."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from scanlock.arrays import Points, read_only
from scanlock.clouds.point_cloud import PointCloud
from scanlock.clouds.voxel_grid import voxel_means
from scanlock.errors import (
    InvalidInput,
    require_at_least,
    require_count,
    require_fraction,
    require_positive,
)
from scanlock.geometry.pose import Pose
from scanlock.models.gaussians import Gaussians
from scanlock.models.k_means import KMeans
from scanlock.optimisation.objectives.constraints import UNCONSTRAINED, Constraints
from scanlock.optimisation.objectives.gaussian_scores import (
    GaussiansToGaussians,
    PointsToGaussians,
    ScoreShape,
)
from scanlock.optimisation.solvers.newton import Newton
from scanlock.optimisation.solvers.problem import Objective
from scanlock.optimisation.solvers.solution import Solution
from scanlock.optimisation.solvers.solver import Solver
from scanlock.optimisation.solvers.staged import minimise_staged
from scanlock.registration.methods.gaussian_scan import (
    GaussianScan,
    dense_scales,
    gaussian_scan,
)
from scanlock.registration.methods.protocol import Method, PreparationLog
from scanlock.segmentation.ground.finder import GroundFinder
from scanlock.segmentation.segmentation import is_obstacle


@dataclass(frozen=True, kw_only=True, slots=True)
class MskmNdt(Method[GaussianScan]):
    """Settings of MSKM-NDT."""

    score: Literal["p2d", "d2d"] = "p2d"
    """Score of the source's points (p2d) or Gaussians (d2d) against Gaussians of the target."""

    cluster_counts: tuple[int, ...] = (12, 50, 200, 400)
    """Number of clusters at each stage, coarse to fine. Each stage starts from the pose of the
    previous one."""

    points: Literal["obstacles", "all"] = "all"
    """Points to cluster: those above the ground, or all. Obstacles take less time, but constrain
    height, roll and pitch by walls and trees only."""

    ground: GroundFinder = field(default_factory=GroundFinder)
    """Ground detection for ``points="obstacles"``."""

    voxel_size: float = 0.5
    """Voxel size for downsampling both scans [m]."""

    k_means: KMeans = field(default_factory=KMeans)
    """Clustering of the downsampled points."""

    min_points: int = 6
    """Minimum number of downsampled points of a cluster."""

    min_deviation: float = 0.1
    """Minimum standard deviation of a Gaussian along any axis [m]."""

    shape: ScoreShape = field(default_factory=lambda: ScoreShape(sharpness=0.3))
    """Score of a Gaussian. A sharpness of 1 halves the basin of convergence."""

    weight_power: float = 0.25
    """Exponent of the number of points in the weight of a Gaussian, for d2d."""

    solver: Solver = field(default_factory=Newton)
    """Solver of each stage."""

    coarse_tolerance: float = 0.01
    """Step tolerance of all stages but the last, as a ratio of the typical standard deviation of
    their Gaussians."""

    def __post_init__(self) -> None:
        if self.score not in ("p2d", "d2d"):
            raise InvalidInput(f"score must be 'p2d' or 'd2d', got {self.score!r}")
        if self.points not in ("obstacles", "all"):
            raise InvalidInput(f"points must be 'obstacles' or 'all', got {self.points!r}")
        if not self.cluster_counts or list(self.cluster_counts) != sorted(self.cluster_counts):
            raise InvalidInput(
                f"cluster_counts must be ascending and not empty, got {self.cluster_counts}"
            )
        for count in self.cluster_counts:
            require_count("cluster_counts", count)
        require_positive("voxel_size", self.voxel_size, unit="m")
        require_count("min_points", self.min_points, 2)
        require_positive("min_deviation", self.min_deviation, unit="m")
        require_at_least("weight_power", self.weight_power, 0.0)
        require_fraction("coarse_tolerance", self.coarse_tolerance)

    @property
    def covariance_factor(self) -> float:
        """Calibrated on simulated pairs, see `Method.covariance_factor`."""
        return 1.06

    def prepare(self, cloud: PointCloud, log: PreparationLog | None = None) -> GaussianScan:
        """Cluster the downsampled points of a scan at each scale and estimate the Gaussians."""
        log = log or PreparationLog()
        with log.stage("ground"):
            if self.points == "obstacles":
                points = cloud.points[is_obstacle(cloud, self.ground.find(cloud))]
            else:
                points = cloud.measured_points
        with log.stage("k-means"):
            # Voxels are in a fixed order, so the order of the input rows does not matter.
            sampled = read_only(voxel_means(points, self.voxel_size))
            gaussians = [self._gaussians(sampled, count) for count in self.cluster_counts]
        scan = gaussian_scan(sampled, gaussians, len(sampled))
        counts = ", ".join(str(len(one)) for one in gaussians)
        log.note(f"{counts} Gaussians by k-means of {len(sampled)} points")
        return scan

    def align(
        self,
        target: GaussianScan,
        source: GaussianScan,
        start: Pose | None = None,
        constraints: Constraints = UNCONSTRAINED,
    ) -> Solution:
        """Minimise the score over the pose at each dense scale, coarse to fine."""
        scales = dense_scales(target, source)
        sizes = [_typical_deviation(target.gaussians[scale]) for scale in scales]
        return minimise_staged(
            self.solver,
            (constraints.applied_to(self._objective(target, source, scale)) for scale in scales),
            [self.coarse_tolerance * size for size in sizes],
            start or Pose.identity(),
        )

    def _gaussians(self, points: Points, count: int) -> Gaussians:
        labels = self.k_means.labels(points, count)
        found = Gaussians.from_labels(points, labels, self.min_points)
        return found.regularised(self.min_deviation)

    def _objective(self, target: GaussianScan, source: GaussianScan, scale: int) -> Objective:
        gaussians, curvature = target.gaussians[scale], self.solver.curvature
        if self.score == "p2d":
            return PointsToGaussians(
                target=gaussians, points=source.points, shape=self.shape, curvature=curvature
            )
        return GaussiansToGaussians(
            target=gaussians,
            source=source.gaussians[scale],
            shape=self.shape,
            weight_power=self.weight_power,
            curvature=curvature,
        )


def _typical_deviation(gaussians: Gaussians) -> float:
    """Return the square root of the median of the largest variances [m]."""
    return float(np.sqrt(np.median(gaussians.max_variances)))
