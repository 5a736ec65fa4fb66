"""Data of the default method: one prepared scan, and one pair of them."""

from dataclasses import dataclass

from scanlock.arrays import short_repr
from scanlock.geometry.pose import Pose
from scanlock.models.gaussians import Gaussians
from scanlock.optimisation.objectives.constraints import Constraints
from scanlock.registration.methods.fine_ndt import FineNdtScan
from scanlock.registration.methods.sparse_refinement import SparseScan
from scanlock.registration.search.bev_grid import BevGrid
from scanlock.registration.verification.agreement import free_space_violation
from scanlock.registration.verification.candidate import plausibility
from scanlock.registration.verification.features import VerificationFeatures
from scanlock.segmentation.cluster_gaussians import MIN_GAUSSIANS, ClusterGaussians


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class AutoData:
    """A scan prepared by `Auto`.

    Attributes
    ----------
    clusters : ClusterGaussians
        Clusters at each scale of `Auto.initial_method`.
    multi_start_gaussians : tuple of Gaussians
        Clusters at each scale of `Auto.multi_start`.
    bev_grid : BevGrid or None
        Grid for the BEV correlation; None without `Auto.search`.
    level_from_scan : Pose or None
        Pose of the scan in its levelled frame; None if no ground was found.
    features : VerificationFeatures
        Features for the scores of candidates.
    fine : FineNdtScan or None
        Cells of the fine NDT; None without `Auto.fine`.
    sparse : SparseScan or None
        Points and tree of a sparse cloud, or of the other one of a pair; None for other clouds,
        or without `Auto.sparse_refinement`.
    """

    clusters: ClusterGaussians
    multi_start_gaussians: tuple[Gaussians, ...]
    bev_grid: BevGrid | None
    level_from_scan: Pose | None
    features: VerificationFeatures
    fine: FineNdtScan | None
    sparse: SparseScan | None = None

    __repr__ = short_repr

    @property
    def has_clusters(self) -> bool:
        """Whether the scan has enough clusters for SGC-NDT and the multi-start refinement."""
        return not self.clusters.insufficient_reason

    @property
    def has_level_grid(self) -> bool:
        """Whether the scan has a BEV grid that is levelled by its ground."""
        return self.bev_grid is not None and self.bev_grid.has_ground

    @property
    def insufficient_reason(self) -> str:
        """Why the scan cannot be registered; empty if it can."""
        reason = self.clusters.insufficient_reason
        if self.fine is None or not reason:
            return reason
        count = len(self.fine.gaussians)
        return "" if count >= MIN_GAUSSIANS else f"{reason}, and {count} Gaussians of small cells"


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class AutoPair:
    """Input of one call of `Auto.align`.

    Attributes
    ----------
    target, source : AutoData
        The prepared scans.
    initial : Pose or None
        Initial pose of the caller.
    constraints : Constraints
        Locked directions and prior.
    """

    target: AutoData
    source: AutoData
    initial: Pose | None
    constraints: Constraints

    @property
    def both_have_clusters(self) -> bool:
        """Whether both scans have enough clusters."""
        return self.target.has_clusters and self.source.has_clusters

    @property
    def both_have_level_grids(self) -> bool:
        """Whether both scans have a BEV grid that is levelled by their ground."""
        return self.target.has_level_grid and self.source.has_level_grid

    def constrained(self, pose: Pose) -> Pose:
        """Return the nearest pose with the locked directions of the initial pose."""
        return self.constraints.project(pose, self.initial or Pose.identity())

    def prior_penalty(self, pose: Pose) -> float:
        """Return the negative log-likelihood of a pose under the prior; 0 without one."""
        prior = self.constraints.prior
        return 0.0 if prior is None else prior.linearise(pose).value

    def plausibility(self, pose: Pose) -> float:
        """Return the score factor of a pose for its free-space violation, in [0, 1]."""
        return plausibility(free_space_violation(self.target.features, self.source.features, pose))
