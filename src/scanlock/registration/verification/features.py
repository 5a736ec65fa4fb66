"""What the verdict looks at: the same of every scan, whatever method registers it."""

from dataclasses import dataclass, field

from scanlock.arrays import Points, frozen
from scanlock.clouds.cell_list import CellList
from scanlock.clouds.point_cloud import PointCloud
from scanlock.clouds.voxel_grid import voxel_labels
from scanlock.models.gaussians import Gaussians
from scanlock.registration.verification.cluster_constraints import (
    ClusterConstraints,
    cluster_constraints,
)
from scanlock.registration.verification.local_planes import LocalPlaneFitter
from scanlock.registration.verification.overlap import self_score
from scanlock.registration.verification.range_image import RangeImage, RangeImager
from scanlock.segmentation.cluster_gaussians import (
    MIN_GAUSSIANS,
    ClusterGaussianExtractor,
    ClusterGaussians,
)

PROBER = LocalPlaneFitter()
"""Chooses the probes of a scan, and finds the surface of the other near them."""

_FINDER = ClusterGaussianExtractor()
_IMAGER = RangeImager()

_RADIUS = 1.5
"""Largest radius of the parts [m]: that of the sharpest scale of SGC-NDT."""


@dataclass(frozen=True, slots=True, eq=False)
class VerificationFeatures:
    """What a pose must lay onto that of the other scan.

    Attributes
    ----------
    cloud : PointCloud
        The checked points of the whole scan.
    listed : CellList
        The same points, to be probed.
    gaussians : Gaussians
        Its parts: clusters above the ground; where there are too few, cubes of the whole scan.
    ranges : RangeImage or None
        How far it saw; None where the origin of its frame is no sensor.
    probes : (m, 3) [m]
        Points of it, spread evenly.
    roughness : float [m]
        Root mean squared distance of its probes from its own surface near them.
    notes : tuple of str
        What was found on the way.
    held : PartHold
        How firmly its clusters hold a pose; not at all for cubes, which are cut where the grid
        lies.
    self_score : float
        The D2D score of its parts with themselves.
    """

    cloud: PointCloud
    cell_list: CellList
    gaussians: Gaussians
    range_image: RangeImage | None
    query_points: Points
    roughness: float
    notes: tuple[str, ...]
    held: ClusterConstraints
    self_score: float = field(init=False)

    def __post_init__(self) -> None:
        frozen(self.query_points)
        object.__setattr__(self, "self_score", self_score(self.gaussians))


def features_from_clusters(
    landmarks: ClusterGaussians, imager: RangeImager | None = _IMAGER
) -> VerificationFeatures:
    """Return the evidence of a scan whose landmarks are known, sharpest scale last."""
    cloud, gaussians, notes = landmarks.cloud, landmarks.gaussians[-1], landmarks.notes
    held = cluster_constraints(gaussians)
    if len(gaussians) < MIN_GAUSSIANS:
        # Bare ground holds some directions, and methods that keep it can be judged by those.
        labels, _ = voxel_labels(cloud.points, _RADIUS)
        least = _FINDER.segmenter.clusters.min_points
        gaussians = Gaussians.from_labels(cloud.points, labels, least)
        gaussians = gaussians.regularised(_FINDER.min_deviation)
        held = ClusterConstraints.none()
        notes = (*notes, f"judged by {len(gaussians)} cubes of the scan")
    range_image = None if imager is None else imager.image(cloud)
    cell_list, query_points = PROBER.cell_list(cloud), PROBER.query_points(cloud)
    roughness = PROBER.fit(cell_list, query_points).roughness
    return VerificationFeatures(
        cloud, cell_list, gaussians, range_image, query_points, roughness, notes, held
    )


def extract_features(cloud: PointCloud) -> VerificationFeatures:
    """Return the evidence of a scan for methods that do not look for its clusters."""
    return features_from_clusters(_FINDER.extract(cloud, [_RADIUS]))
