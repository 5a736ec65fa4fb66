"""Verification features of a scan: everything that verification needs of one scan alone."""

from dataclasses import dataclass, field

from scanlock.arrays import Points, frozen, short_repr
from scanlock.clouds.cell_list import CellList
from scanlock.clouds.point_cloud import PointCloud
from scanlock.clouds.voxel_grid import voxel_labels
from scanlock.models.gaussians import Gaussians
from scanlock.registration.verification.cluster_constraints import (
    ClusterConstraints,
    cluster_constraints,
)
from scanlock.registration.verification.local_planes import LocalPlaneFitter, LocalPlanes
from scanlock.registration.verification.low_objects import LowObjects, find_low_objects
from scanlock.registration.verification.overlap import self_score
from scanlock.registration.verification.range_image import RangeImage, RangeImager
from scanlock.registration.verification.self_similarity import SelfSimilarity
from scanlock.segmentation.cluster_gaussians import (
    MIN_GAUSSIANS,
    ClusterGaussianExtractor,
    ClusterGaussians,
)

PLANE_FITTER = LocalPlaneFitter()
"""Settings of the query points of a scan, and of the planes fitted to the other scan there."""

_SPARSE_PLANE_FITTER = LocalPlaneFitter(
    voxel_size=0.25, max_points=2000, radii=(0.5, 0.7, 1.0, 1.4, 2.0)
)
"""The same for sparse scans, in units of their length scale. Planes of eight points are noisy, so
there are more of them. The surface bends within a unit, so the radius grows in smaller steps."""

_EXTRACTOR = ClusterGaussianExtractor()
_RANGE_IMAGER = RangeImager()

_MAX_RADIUS = 1.5
"""Maximum radius of a cluster [m], as at the finest scale of SGC-NDT."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class VerificationFeatures:
    """Verification features of a scan, in its local frame.

    Attributes
    ----------
    cloud : PointCloud
        Checked points of the whole scan.
    cell_list : CellList
        The same points, indexed for plane fits.
    gaussians : Gaussians
        Gaussians of the clusters above the ground; of voxels of the whole scan where there are
        too few clusters.
    range_image : RangeImage or None
        Range image of the scan; None if the origin of its frame is not the sensor.
    query_points : (m, 3) [m]
        Evenly distributed points of the scan.
    roughness : float [m]
        Root mean squared distance between the query points and the planes of the scan itself.
    notes : tuple of str
        Facts for the notes of the result.
    cluster_constraints : ClusterConstraints
        Information on the pose from the clusters; none from voxels, whose boundaries depend on
        the grid.
    low_objects : LowObjects
        Low objects of the scan.
    self_similarity : SelfSimilarity
        Autocorrelation of the view from above of the scan.
    self_score : float
        D2D score of the Gaussians with themselves, which normalises the score of two scans.
    """

    cloud: PointCloud
    cell_list: CellList
    gaussians: Gaussians
    range_image: RangeImage | None
    query_points: Points
    roughness: float
    notes: tuple[str, ...]
    cluster_constraints: ClusterConstraints
    low_objects: LowObjects
    self_similarity: SelfSimilarity
    self_score: float = field(init=False)

    __repr__ = short_repr

    def __post_init__(self) -> None:
        frozen(self.query_points)
        object.__setattr__(self, "self_score", self_score(self.gaussians))

    def planes_around(self, queries: Points) -> LocalPlanes:
        """Fit planes to the scan around (m, 3) query points [m] in its frame."""
        return _plane_fitter(self.cloud).fit(self.cell_list, queries)

    @property
    def insufficient_reason(self) -> str:
        """Why no pose of the scan can be verified; empty if one can."""
        count = len(self.gaussians)
        if count >= MIN_GAUSSIANS:
            return ""
        return f"has only {count} clusters or voxels with enough points"


def _plane_fitter(cloud: PointCloud) -> LocalPlaneFitter:
    """Return the settings of the planes of a cloud."""
    return _SPARSE_PLANE_FITTER if cloud.takes_sparse_settings else PLANE_FITTER


def features_from_clusters(
    clusters: ClusterGaussians, imager: RangeImager | None = _RANGE_IMAGER
) -> VerificationFeatures:
    """Compute the features of a scan from its cluster Gaussians of the last scale."""
    cloud, gaussians, notes = clusters.cloud, clusters.gaussians[-1], clusters.notes
    constraints = cluster_constraints(gaussians)
    if len(gaussians) < MIN_GAUSSIANS:
        # Bare ground constrains some directions, enough for the poses of methods that use it.
        labels, _ = voxel_labels(cloud.points, _MAX_RADIUS)
        min_points = _EXTRACTOR.segmenter.clusters.min_points
        gaussians = Gaussians.from_labels(cloud.points, labels, min_points)
        gaussians = gaussians.regularised(_EXTRACTOR.min_deviation)
        constraints = ClusterConstraints.unconstrained()
        notes = (*notes, f"too few clusters: verified with {len(gaussians)} voxel Gaussians")
    fitter = _plane_fitter(cloud)
    low_objects = find_low_objects(clusters)
    cell_list, query_points = fitter.cell_list(cloud), fitter.query_points(cloud)
    return VerificationFeatures(
        cloud=cloud,
        cell_list=cell_list,
        gaussians=gaussians,
        range_image=None if imager is None else imager.image(cloud),
        query_points=query_points,
        roughness=fitter.fit(cell_list, query_points).rmse,
        notes=notes,
        cluster_constraints=constraints,
        low_objects=low_objects,
        self_similarity=SelfSimilarity.of(low_objects.occupied),
    )


def extract_features(cloud: PointCloud) -> VerificationFeatures:
    """Extract the features of a scan, for methods that do not cluster it."""
    return features_from_clusters(_EXTRACTOR.extract(cloud, [_MAX_RADIUS]))
