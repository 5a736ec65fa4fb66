"""What the verdict looks at: the same of every scan, whatever method registers it."""

from dataclasses import dataclass, field

from scanlock.arrays import Points, frozen
from scanlock.clouds.cell_list import CellList
from scanlock.clouds.point_cloud import PointCloud
from scanlock.clouds.voxel_grid import voxel_labels
from scanlock.models.gaussians import Gaussians
from scanlock.registration.verification.cluster_constraints import PartHold, held_by_parts
from scanlock.registration.verification.local_planes import SurfaceProber
from scanlock.registration.verification.overlap import self_score
from scanlock.registration.verification.range_image import RangeImage, RangeImager
from scanlock.segmentation.cluster_gaussians import LEAST_PARTS, LandmarkFinder, Landmarks

PROBER = SurfaceProber()
"""Chooses the probes of a scan, and finds the surface of the other near them."""

_FINDER = LandmarkFinder()
_IMAGER = RangeImager()

_RADIUS = 1.5
"""Largest radius of the parts [m]: that of the sharpest scale of SGC-NDT."""


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
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
    listed: CellList
    gaussians: Gaussians
    ranges: RangeImage | None
    probes: Points
    roughness: float
    notes: tuple[str, ...]
    held: PartHold
    self_score: float = field(init=False)

    def __post_init__(self) -> None:
        frozen(self.probes)
        object.__setattr__(self, "self_score", self_score(self.gaussians))


def evidence_of(landmarks: Landmarks, imager: RangeImager | None = _IMAGER) -> Evidence:
    """Return the evidence of a scan whose landmarks are known, sharpest scale last."""
    cloud, gaussians, notes = landmarks.cloud, landmarks.gaussians[-1], landmarks.notes
    held = held_by_parts(gaussians)
    if len(gaussians) < LEAST_PARTS:
        # Bare ground holds some directions, and methods that keep it can be judged by those.
        labels, _ = voxel_labels(cloud.points, _RADIUS)
        least = _FINDER.segmenter.clusters.least_count
        gaussians = Gaussians.from_labels(cloud.points, labels, least)
        gaussians = gaussians.floored(_FINDER.deviation_floor)
        held = PartHold.none()
        notes = (*notes, f"judged by {len(gaussians)} cubes of the scan")
    ranges = None if imager is None else imager.image(cloud)
    listed, probes = PROBER.listed(cloud), PROBER.probes(cloud)
    roughness = PROBER.probe(listed, probes).roughness
    return Evidence(cloud, listed, gaussians, ranges, probes, roughness, notes, held)


def find_evidence(cloud: PointCloud) -> Evidence:
    """Return the evidence of a scan for methods that do not look for its clusters."""
    return evidence_of(_FINDER.find(cloud, [_RADIUS]))
