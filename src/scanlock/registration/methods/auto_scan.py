"""What the default method keeps of a scan."""

from collections.abc import Mapping
from dataclasses import dataclass

from scanlock.clouds.point_cloud import PointCloud
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
    cloud : PointCloud
        The checked points of the whole scan.
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
    timings : mapping of str to float [s]
        Wall time of each stage.
    """

    cloud: PointCloud
    clusters: ClusterGaussians
    gaussians: tuple[Gaussians, ...]
    bev_grid: BevGrid | None
    level: Pose | None
    features: VerificationFeatures
    fine: FineNdtScan | None
    timings: Mapping[str, float]

    @property
    def notes(self) -> tuple[str, ...]:
        """What was found on the way."""
        if self.fine is None:
            return self.clusters.notes
        cells = f"{len(self.fine.gaussians)} cells of {self.fine.width:g} m"
        return (*self.clusters.notes, cells)

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
