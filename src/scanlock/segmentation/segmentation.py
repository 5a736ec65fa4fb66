"""Ground and clusters of one scan, in the rows of the caller's own array."""

from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from scanlock.arrays import Labels, Mask, Points, Vector, frozen, read_only
from scanlock.clouds.point_cloud import PointCloud
from scanlock.geometry.rotations import rotation_onto_z
from scanlock.interrupts import plain_interrupts
from scanlock.kernels.points.rows import chosen_points
from scanlock.segmentation.clusters import ClusterFinder
from scanlock.segmentation.ground.finder import Ground, GroundFinder, GroundStatus

GROUND = 0
"""Label of ground points; clusters count from 1."""

LEFT_OUT = -1
"""Label of points that are neither: not finite, at zero, beneath the ground (reflections), out of
range, or in too small a cluster."""


@dataclass(frozen=True, eq=False)
class Segmentation:
    """What each point of a scan belongs to.

    Attributes
    ----------
    labels : (n,) int64
        One for each row of the caller's array: 0 ground, 1..k clusters, -1 neither.
    cluster_count : int
        Number k of clusters.
    ground : Ground
        How the ground was found, or why not; its arrays follow ``cloud.points``.
    cloud : PointCloud
        The checked points.
    """

    labels: Labels
    cluster_count: int
    ground: Ground
    cloud: PointCloud

    def __post_init__(self) -> None:
        frozen(self.labels)

    @property
    def is_ground(self) -> Mask:
        """(n,) bool, one for each row of the caller's array."""
        return self.labels == GROUND

    @cached_property
    def clusters(self) -> tuple[Labels, ...]:
        """Rows of the caller's array in each cluster; ``clusters[j]`` has label ``j + 1``."""
        order = np.argsort(self.labels, kind="stable")
        starts = np.searchsorted(self.labels[order], np.arange(1, self.cluster_count + 2))
        return tuple(order[a:b] for a, b in pairwise(starts))

    @property
    def height(self) -> Vector:
        """(n,) height above the modelled ground [m] for the caller's rows; NaN if unknown."""
        full = np.full(self.cloud.input_count, np.nan)
        full[self.cloud.rows] = self.ground.height
        return full


@dataclass(frozen=True, kw_only=True, slots=True)
class Segmenter:
    """Settings of segmentation: how the ground is found, how the rest is clustered."""

    ground: GroundFinder = field(default_factory=GroundFinder)
    """Finds the ground, chi."""

    clusters: ClusterFinder = field(default_factory=ClusterFinder)
    """Clusters what is not ground, beta."""

    def segment(self, points: ArrayLike | PointCloud) -> Segmentation:
        """Return what each row of an (n, 3+) array or a cloud belongs to."""
        cloud = PointCloud.from_array(points)
        ground = self.ground.find(cloud)
        obstacles = np.flatnonzero(is_obstacle(cloud, ground))
        labels, count = self.clusters.label(upright(cloud.points[obstacles], ground))
        all_labels = np.where(ground.is_ground, GROUND, LEFT_OUT)
        all_labels[obstacles] = np.where(labels >= 0, labels + 1, LEFT_OUT)
        return Segmentation(cloud.to_input_rows(all_labels, LEFT_OUT), count, ground, cloud)


def is_obstacle(cloud: PointCloud, ground: Ground) -> Mask:
    """Return which points of a cloud stand on its ground: neither of it nor beneath it.

    Nor is one that measured nothing: thousands of them would make the heaviest cluster of all,
    at the sensor.
    """
    return cloud.is_measured & ~(ground.is_ground | ground.is_below)


def obstacle_points(cloud: PointCloud, ground: Ground) -> Points:
    """Return the (m, 3) points of a cloud for which `is_obstacle` holds."""
    points = chosen_points(cloud.points, read_only(is_obstacle(cloud, ground)))
    frozen(points)
    return points


def upright(points: Points, ground: Ground) -> Points:
    """Return the points turned so that a tilted sensor's ground lies level.

    Polar bins are columns: across a tilted scene they would mix what stands side by side.
    """
    if ground.status is not GroundStatus.TILTED:
        return points
    return points @ rotation_onto_z(ground.up).T


@plain_interrupts()
def segment(points: ArrayLike | PointCloud, segmenter: Segmenter | None = None) -> Segmentation:
    """Return the ground and the clusters of one scan.

    Parameters
    ----------
    points : (n, 3+) array or PointCloud [m]
        One scan in the sensor's frame, z roughly upwards; float32 or float64, columns past the
        third ignored. Rows with NaN or Inf get the label -1.
    segmenter : Segmenter, optional
        Settings; the defaults need no sensor height.

    Returns
    -------
    Segmentation
        ``labels``, ``is_ground`` and ``clusters`` follow the rows of `points`. A scan without
        a believable ground has none: ``ground.status`` and ``ground.reason`` say so.

    Raises
    ------
    InvalidInput
        Wrong shape or type, or no finite point.
    """
    return (segmenter or Segmenter()).segment(points)
