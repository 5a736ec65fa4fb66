"""Segmented greedy cluster NDT: Algorithm 1 of Das et al. 2013, and its D2D sibling."""

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

_POINT_BLUR = 2.0 * 2**0.5
"""Blur of the target in P2D over that of either scan in D2D.

Points cannot be blurred, so the target takes the blur of both (a factor of root two); points
also lack the extent of clusters, and twice as much again gives P2D the basin of D2D.
"""


@dataclass(frozen=True, kw_only=True, slots=True)
class SgcNdt(Method[ClusterGaussians]):
    """Settings of SGC-NDT; `prepare` each scan once, `align` as many pairs as wanted."""

    score: Literal["d2d", "p2d"] = "d2d"
    """Gaussians of the source, or its obstacle points, against Gaussians of the target."""

    extractor: ClusterGaussianExtractor = field(default_factory=ClusterGaussianExtractor)
    """Lines 1 to 5: ground removed, the rest clustered, clusters as Gaussians."""

    schedule: CoarseToFine = field(default_factory=CoarseToFine)
    """Lines 6 to 21, at each scale in turn; `PAPER_SCALES` is the paper's single one."""

    voxel_size: float = 0.5
    """P2D takes the mean of the source's points in each voxel of this side [m]."""

    voxel_size_ratio: float = 1.0
    """P2D: under a blur the voxels grow to this share of it."""

    merge_ratio: float = 1.0
    """D2D: under a blur, the Gaussians in one cube of this many blurs become one; 0 leaves them
    apart. The blur hides which they were; cubes of two blurs lose a pair carried by hand."""

    def __post_init__(self) -> None:
        if self.score not in ("d2d", "p2d"):
            raise InvalidInput(f"score must be 'd2d' or 'p2d', got {self.score!r}")
        require_positive("voxel_size", self.voxel_size, unit="m")
        require_fraction("voxel_size_ratio", self.voxel_size_ratio)
        require_at_least("merge_ratio", self.merge_ratio, 0.0)

    @property
    def covariance_factor(self) -> float:
        """Measured on simulated pairs; see `benchmarks/uncertainty`."""
        return 1.16 if self.score == "d2d" else 1.11

    def prepare(self, cloud: PointCloud, log: PreparationLog | None = None) -> ClusterGaussians:
        """Return what the method keeps of a scan."""
        log = log or PreparationLog()
        radii = [scale.max_radius for scale in self.schedule.scales]
        clusters = self.extractor.find(cloud, radii, log.clock)
        if clusters.insufficient:
            raise InsufficientData(clusters.insufficient)
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
        """Return the pose that carries the source onto the target, from a start."""
        curvature = self.schedule.solver.curvature

        def objective_at(index: int) -> Objective:
            scale = self.schedule.scales[index]
            blur = scale.smoothing
            if self.score == "p2d":
                spacing = max(self.voxel_size, self.voxel_size_ratio * blur)
                return PointsToGaussians(
                    target=target.gaussians[index].inflated(_POINT_BLUR * blur),
                    points=read_only(voxel_means(source.obstacles, spacing)),
                    curvature=curvature,
                )
            return GaussiansToGaussians(
                target=self._blurred(target.gaussians[index], scale),
                source=self._blurred(source.gaussians[index], scale),
                weight_power=scale.weight_power,
                curvature=curvature,
            )

        return self.schedule.minimise(
            lambda index: constraints.applied_to(objective_at(index)), start or Pose.identity()
        )

    def _blurred(self, gaussians: Gaussians, scale: Scale) -> Gaussians:
        width = self.merge_ratio * scale.smoothing
        # Without weights by count there is no count that would stand for several Gaussians.
        if width > 0.0 and scale.weight_power > 0.0:
            gaussians = gaussians.merged(width, scale.weight_power)
        return gaussians.inflated(scale.smoothing)
