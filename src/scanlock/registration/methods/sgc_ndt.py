"""Segmented greedy cluster NDT: Algorithm 1 of Das et al. 2013 (P2D), and its D2D variant."""

from dataclasses import dataclass, field
from typing import Literal

from scanlock.arrays import read_only
from scanlock.clouds.point_cloud import PointCloud
from scanlock.clouds.voxel_grid import voxel_means
from scanlock.errors import InvalidInput, require_at_least, require_fraction, require_positive
from scanlock.geometry.pose import Pose
from scanlock.models.gaussians import Gaussians
from scanlock.optimisation.objectives.constraints import UNCONSTRAINED, Constraints
from scanlock.optimisation.objectives.gaussian_scores import GaussiansToGaussians, PointsToGaussians
from scanlock.optimisation.solvers.problem import Objective
from scanlock.optimisation.solvers.solution import Solution
from scanlock.registration.methods.coarse_to_fine import CoarseToFine, Scale
from scanlock.registration.methods.protocol import InsufficientData, Method, PreparationLog
from scanlock.segmentation.cluster_gaussians import ClusterGaussianExtractor, ClusterGaussians

_P2D_SMOOTHING = 2.0 * 2**0.5
"""Smoothing of the target in P2D, relative to that of either scan in D2D.

Points cannot be smoothed, so the target takes the smoothing of both scans: a factor of root two.
Points also lack the extent of clusters; twice as much smoothing gives P2D the basin of D2D.
"""


@dataclass(frozen=True, kw_only=True, slots=True)
class SgcNdt(Method[ClusterGaussians]):
    """Settings of SGC-NDT; `prepare` each scan once, `align` any pair."""

    score: Literal["d2d", "p2d"] = "d2d"
    """Gaussians of the source, or its obstacle points, against Gaussians of the target."""

    extractor: ClusterGaussianExtractor = field(default_factory=ClusterGaussianExtractor)
    """Algorithm 1, lines 1 to 5: ground removal, clustering, Gaussians of the clusters."""

    schedule: CoarseToFine = field(default_factory=CoarseToFine)
    """Algorithm 1, lines 6 to 21, repeated at each scale; the paper has one (`PAPER_SCALES`)."""

    voxel_size: float = 0.5
    """Voxel size of the downsampled source points in P2D [m]."""

    voxel_size_ratio: float = 1.0
    """Minimum voxel size in P2D as a fraction of the smoothing."""

    merge_ratio: float = 1.0
    """Side of the voxels in which the Gaussians of a smoothed scale are merged in D2D, as a
    multiple of the smoothing; 0 disables merging. A multiple of 2 fails on a pair of handheld
    scans."""

    def __post_init__(self) -> None:
        if self.score not in ("d2d", "p2d"):
            raise InvalidInput(f"score must be 'd2d' or 'p2d', got {self.score!r}")
        require_positive("voxel_size", self.voxel_size, unit="m")
        require_fraction("voxel_size_ratio", self.voxel_size_ratio)
        require_at_least("merge_ratio", self.merge_ratio, 0.0)

    @property
    def covariance_factor(self) -> float:
        """Ratio of actual to estimated deviations, see `Method.covariance_factor`."""
        return 1.16 if self.score == "d2d" else 0.95

    def prepare(self, cloud: PointCloud, log: PreparationLog | None = None) -> ClusterGaussians:
        """Extract the cluster Gaussians of a scan at each scale; see `Method.prepare`."""
        log = log or PreparationLog()
        radii = [scale.max_radius for scale in self.schedule.scales]
        clusters = self.extractor.extract(cloud, radii, log.clock)
        if clusters.insufficient_reason:
            raise InsufficientData(clusters.insufficient_reason)
        for note in clusters.notes:
            log.note(note)
        log.clusters = clusters
        return clusters

    def align(
        self,
        target: ClusterGaussians,
        source: ClusterGaussians,
        start: Pose | None = None,
        constraints: Constraints = UNCONSTRAINED,
    ) -> Solution:
        """Estimate the pose, target from source, from an initial pose; see `Method.align`."""
        objective = self._p2d_objective if self.score == "p2d" else self._d2d_objective
        return self.schedule.minimise(
            lambda index: constraints.applied_to(objective(target, source, index)),
            start or Pose.identity(),
        )

    def _p2d_objective(
        self, target: ClusterGaussians, source: ClusterGaussians, index: int
    ) -> Objective:
        smoothing = self.schedule.scales[index].smoothing
        voxel_size = max(self.voxel_size, self.voxel_size_ratio * smoothing)
        return PointsToGaussians(
            target=target.gaussians[index].inflated(_P2D_SMOOTHING * smoothing),
            points=read_only(voxel_means(source.obstacles, voxel_size)),
            curvature=self.schedule.solver.curvature,
        )

    def _d2d_objective(
        self, target: ClusterGaussians, source: ClusterGaussians, index: int
    ) -> Objective:
        scale = self.schedule.scales[index]
        return GaussiansToGaussians(
            target=self._smoothed(target.gaussians[index], scale),
            source=self._smoothed(source.gaussians[index], scale),
            weight_power=scale.weight_power,
            curvature=self.schedule.solver.curvature,
        )

    def _smoothed(self, gaussians: Gaussians, scale: Scale) -> Gaussians:
        voxel_size = self.merge_ratio * scale.smoothing
        # With a weight power of 0, no count gives one Gaussian the weight of several.
        if voxel_size > 0.0 and scale.weight_power > 0.0:
            gaussians = gaussians.merged(voxel_size, scale.weight_power)
        return gaussians.inflated(scale.smoothing)
