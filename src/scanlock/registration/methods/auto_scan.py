"""What the default method keeps of a scan."""

from dataclasses import dataclass

from scanlock.geometry.pose import Pose
from scanlock.models.gaussians import Gaussians
from scanlock.registration.methods.fine_ndt import FineNdtScan
from scanlock.registration.search.bev_grid import BevGrid
from scanlock.registration.verification.features import VerificationFeatures
from scanlock.segmentation.cluster_gaussians import MIN_GAUSSIANS, ClusterGaussians


@dataclass(frozen=True, slots=True, eq=False)
class AutoScan:
    """A scan ready to be registered, as target or as source.

    Attributes
    ----------
    landmarks : Landmarks
        Its clusters at each scale of the descent from an initial pose.
    parts : tuple of Gaussians
        Its clusters at each scale of the descents from hypotheses.
    view : PlanView or None
        What the search sees of it.
    level : Pose or None
        Turns it upright, with its ground at z = 0; None where no ground says which way is up.
    evidence : Evidence
        What candidates are judged by.
    fine : FineScan or None
        Its small cells.
    """

    clusters: ClusterGaussians
    gaussians: tuple[Gaussians, ...]
    bev_grid: BevGrid | None
    level: Pose | None
    features: VerificationFeatures
    fine: FineNdtScan | None

    @property
    def has_ground(self) -> bool:
        """Whether its ground says which way is up."""
        return self.bev_grid is not None and self.bev_grid.has_ground

    @property
    def has_gaussians(self) -> bool:
        """Whether there are clusters enough to descend by."""
        return not self.clusters.insufficient

    @property
    def insufficient(self) -> str:
        """Why the scan cannot be registered; empty when it can."""
        if self.has_gaussians or self.fine is None:
            return self.clusters.insufficient
        cells = len(self.fine.gaussians)
        return (
            ""
            if cells >= MIN_GAUSSIANS
            else f"{self.clusters.insufficient}, and {cells} small cells"
        )
