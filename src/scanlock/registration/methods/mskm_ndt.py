"""Multi-scale k-means NDT: Das and Waslander 2012, in three dimensions."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from scanlock.arrays import Points, frozen, read_only
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
from scanlock.optimisation.solvers.staged import Stage, minimise_staged, with_tolerance
from scanlock.registration.methods.protocol import Method, PreparationLog
from scanlock.registration.methods.scales import dense_scales, require_enough, shares_of
from scanlock.registration.methods.voxel_scan import measured_points
from scanlock.segmentation.ground.finder import GroundDetector, GroundFinder
from scanlock.segmentation.segmentation import is_obstacle


@dataclass(frozen=True, slots=True, eq=False)
class KMeansScan:
    """A scan ready to be registered, as target or as source.

    Attributes
    ----------
    points : (n, 3) [m]
        The thinned points that were parted.
    gaussians : tuple of Gaussians
        One set for each number of parts, fewest first.
    shares : tuple of float
        Share of the thinned points that each set holds.
    """

    points: Points
    gaussians: tuple[Gaussians, ...]
    shares: tuple[float, ...]

    def __post_init__(self) -> None:
        frozen(self.points)


@dataclass(frozen=True, kw_only=True, slots=True)
class MskmNdt(Method[KMeansScan]):
    """Settings of MSKM-NDT; `prepare` each scan once, `align` as many pairs as wanted."""

    score: Literal["p2d", "d2d"] = "p2d"
    """Points of the source, or its Gaussians, against the Gaussians of the target."""

    cluster_counts: tuple[int, ...] = (12, 50, 200, 400)
    """How many parts at each scale; fewest first, each scale from the pose of the last."""

    points: Literal["obstacles", "all"] = "all"
    """What is parted: the points above the ground, or all. Obstacles are fewer and faster, but
    leave height, roll and pitch to walls and trees."""

    ground: GroundDetector = field(default_factory=GroundFinder)
    """Finds the ground that obstacles stand on."""

    voxel_size: float = 0.5
    """The mean of the points in each cube of this side [m] stands for them."""

    k_means: KMeans = field(default_factory=KMeans)
    """Parts the thinned points."""

    min_points: int = 6
    """Parts of fewer thinned points are left out."""

    min_deviation: float = 0.1
    """Least standard deviation of a Gaussian along any axis [m]."""

    shape: ScoreShape = field(default_factory=lambda: ScoreShape(sharpness=0.3))
    """The score of a pair; a sharpness of 1 halves the basin."""

    weight_power: float = 0.25
    """D2D: Gaussians weigh as their counts to this power."""

    solver: Solver = field(default_factory=Newton)
    """Minimises at each scale."""

    coarse_tolerance: float = 0.01
    """All scales but the last stop at steps below this share of their typical deviation."""

    def __post_init__(self) -> None:
        if self.score not in ("p2d", "d2d"):
            raise InvalidInput(f"score must be 'p2d' or 'd2d', got {self.score!r}")
        if self.points not in ("obstacles", "all"):
            raise InvalidInput(f"points must be 'obstacles' or 'all', got {self.points!r}")
        if not self.cluster_counts or list(self.cluster_counts) != sorted(self.cluster_counts):
            raise InvalidInput(
                f"counts must not fall from scale to scale, got {self.cluster_counts}"
            )
        for count in self.cluster_counts:
            require_count("cluster_counts", count)
        require_positive("voxel_size", self.voxel_size, unit="m")
        require_count("min_points", self.min_points, 2)
        require_positive("deviation_floor", self.min_deviation, unit="m")
        require_at_least("weight_power", self.weight_power, 0.0)
        require_fraction("loose_step", self.coarse_tolerance)

    @property
    def covariance_factor(self) -> float:
        """Measured on simulated pairs; see `benchmarks/uncertainty`."""
        return 1.06

    def prepare(self, cloud: PointCloud, log: PreparationLog | None = None) -> KMeansScan:
        """Return what the method keeps of a scan."""
        log = log or PreparationLog()
        with log.stage("ground"):
            if self.points == "obstacles":
                points = cloud.points[is_obstacle(cloud, self.ground.find(cloud))]
            else:
                points = measured_points(cloud)
        with log.stage("k-means"):
            # In the order of their cubes, so that the order of the caller's rows does not matter.
            thinned = read_only(voxel_means(points, self.voxel_size))
            gaussians = tuple(self._gaussians(thinned, count) for count in self.cluster_counts)
        shares = shares_of(gaussians, len(thinned))
        scan = KMeansScan(thinned, gaussians, shares)
        require_enough(scan, "Gaussians")
        found = ", ".join(str(len(one)) for one in gaussians)
        log.note(f"{found} Gaussians by k-means of {len(thinned)} points")
        return scan

    def align(
        self,
        target: KMeansScan,
        source: KMeansScan,
        start: Pose | None = None,
        constraints: Constraints = UNCONSTRAINED,
    ) -> Solution:
        """Return the pose that carries the source onto the target, from a start."""
        return minimise_staged(self._stages(target, source, constraints), start or Pose.identity())

    def _gaussians(self, points: Points, count: int) -> Gaussians:
        labels = self.k_means.labels(points, count)
        found = Gaussians.from_labels(points, labels, self.min_points)
        return found.regularised(self.min_deviation)

    def _stages(
        self, target: KMeansScan, source: KMeansScan, constraints: Constraints
    ) -> Iterator[Stage]:
        scales = dense_scales(target, source)
        for scale in scales:
            stays, moves = target.gaussians[scale], source.gaussians[scale]
            deviation = float(np.sqrt(np.median(stays.max_variances)))
            loose = 0.0 if scale == scales[-1] else self.coarse_tolerance * deviation
            objective = self._objective(stays, moves, source.points)
            yield with_tolerance(self.solver, loose), constraints.applied_to(objective)

    def _objective(self, target: Gaussians, source: Gaussians, points: Points) -> Objective:
        if self.score == "p2d":
            return PointsToGaussians(
                target=target, points=points, shape=self.shape, curvature=self.solver.curvature
            )
        return GaussiansToGaussians(
            target=target,
            source=source,
            shape=self.shape,
            weight_power=self.weight_power,
            curvature=self.solver.curvature,
        )
