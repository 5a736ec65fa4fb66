"""What the verdict looks at: the same of every scan, whatever method registers it."""

from dataclasses import dataclass

from scanlock.clouds.point_cloud import PointCloud
from scanlock.clouds.voxel_grid import voxel_labels
from scanlock.models.gaussians import Gaussians
from scanlock.registration.landmarks import LEAST_PARTS, LandmarkFinder, Landmarks

_RADIUS = 1.5
"""Largest radius of the parts [m]: that of the sharpest scale of SGC-NDT."""


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """The parts of a scan that a pose must lay onto those of the other.

    Attributes
    ----------
    gaussians : Gaussians
        Clusters above the ground; where there are too few, cubes of the whole scan.
    notes : tuple of str
        What was found on the way.
    """

    gaussians: Gaussians
    notes: tuple[str, ...]


def evidence_of(landmarks: Landmarks) -> Evidence:
    """Return what SGC-NDT registers: it is what the verdict looks at, and found already."""
    return Evidence(landmarks.gaussians[-1], landmarks.notes)


def find_evidence(cloud: PointCloud) -> Evidence:
    """Return the evidence of a scan for methods that do not look for its clusters."""
    finder = LandmarkFinder()
    found = evidence_of(finder.find(cloud, [_RADIUS]))
    if len(found.gaussians) >= LEAST_PARTS:
        return found
    # Bare ground holds some directions, and the methods that keep it can be judged by those.
    labels, _ = voxel_labels(cloud.points, _RADIUS)
    gaussians = Gaussians.from_labels(
        cloud.points, labels, finder.segmenter.clusters.least_count
    ).floored(finder.deviation_floor)
    return Evidence(gaussians, (*found.notes, f"judged by {len(gaussians)} cubes of the scan"))
