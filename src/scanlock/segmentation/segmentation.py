"""Segmentation of one scan into ground and clusters, by row of the input array."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from scanlock.arrays import Labels, Mask, Points, Vector, frozen, read_only
from scanlock.clouds.coordinates import HasPoints
from scanlock.clouds.point_cloud import PointCloud
from scanlock.geometry.rotations import rotation_onto_z
from scanlock.interrupts import plain_interrupts
from scanlock.kernels.points.rows import selected_points
from scanlock.segmentation.clusters import ClusterFinder
from scanlock.segmentation.ground.finder import (
    Ground,
    GroundDetector,
    GroundFinder,
    GroundStatus,
)

GROUND = 0
"""Label of ground points; clusters have the labels 1 to k."""

LEFT_OUT = -1
"""Label of all other points.

These are not finite, at the origin (no return), below the ground (reflections), out of range, or in
clusters of too few points.
"""


@dataclass(frozen=True, eq=False)
class Segmentation:
    """Segmentation of a scan into ground and clusters.

    Unlike other labels of scanlock, `labels` contain the ground as well: 0 is ground, so the
    clusters are numbered from 1, and cluster ``clusters[j]`` has the label ``j + 1``. A point that
    is neither has the label -1.

    Attributes
    ----------
    labels : (n,) int64
        Label of each row of the input array: 0 for ground, 1 to k for clusters, -1 for neither.
    cluster_count : int
        Number k of clusters.
    ground : Ground
        Result of ground segmentation; its arrays follow ``cloud.points``.
    cloud : PointCloud
        Validated points.
    """

    labels: Labels
    cluster_count: int
    ground: Ground
    cloud: PointCloud

    def __post_init__(self) -> None:
        frozen(self.labels)

    @property
    def is_ground(self) -> Mask:
        """(n,) whether each row of the input array is ground."""
        return self.labels == GROUND

    @cached_property
    def clusters(self) -> tuple[Labels, ...]:
        """Rows of the input array in each cluster; ``clusters[j]`` has the label ``j + 1``."""
        order = np.argsort(self.labels, kind="stable")
        starts = np.searchsorted(self.labels[order], np.arange(1, self.cluster_count + 2))
        return tuple(order[a:b] for a, b in pairwise(starts))

    @property
    def height(self) -> Vector:
        """(n,) height of each row of the input array above the ground [m]; NaN if unknown."""
        full = np.full(self.cloud.input_count, np.nan)
        full[self.cloud.rows] = self.ground.height
        return full

    def __repr__(self) -> str:
        share = float(np.mean(self.is_ground))
        return (
            f"Segmentation({len(self.labels):,} points, ground {self.ground.status.value} "
            f"({share:.0%}), {self.cluster_count} clusters)"
        )


@dataclass(frozen=True, kw_only=True, slots=True)
class Segmenter:
    """Settings of segmentation."""

    ground: GroundDetector = field(default_factory=GroundFinder)
    """Ground segmentation, chi."""

    clusters: ClusterFinder = field(default_factory=ClusterFinder)
    """Clustering of the points above the ground, beta."""

    def segment(self, points: ArrayLike | HasPoints | PointCloud) -> Segmentation:
        """Segment a scan; parameters and errors are those of `scanlock.segment`."""
        cloud = PointCloud.from_array(points)
        ground = self.ground.find(cloud)
        obstacles = np.flatnonzero(is_obstacle(cloud, ground))
        labels, count = self.clusters.label(upright(cloud.points[obstacles], ground))
        all_labels = np.where(ground.is_ground, GROUND, LEFT_OUT)
        all_labels[obstacles] = np.where(labels >= 0, labels + 1, LEFT_OUT)
        return Segmentation(cloud.to_input_rows(all_labels, LEFT_OUT), count, ground, cloud)


def is_obstacle(cloud: PointCloud, ground: Ground) -> Mask:
    """Return (n,) whether each point of a cloud is an obstacle: neither ground nor below it.

    Points at the origin (no return) are not obstacles. Thousands of them would form the largest
    cluster.
    """
    return cloud.is_measured & ~(ground.is_ground | ground.is_below)


def obstacle_points(cloud: PointCloud, ground: Ground) -> Points:
    """Return the (m, 3) obstacle points of a cloud [m]; see `is_obstacle`."""
    points = selected_points(cloud.points, read_only(is_obstacle(cloud, ground)))
    frozen(points)
    return points


def upright(points: Points, ground: Ground) -> Points:
    """Return points [m] levelled by the ground of a tilted sensor, otherwise unchanged.

    Polar bins are vertical columns; in a tilted frame one bin would contain neighbouring objects.
    """
    if ground.status is not GroundStatus.TILTED:
        return points
    return points @ rotation_onto_z(ground.up).T


@plain_interrupts()
def segment(
    points: ArrayLike | HasPoints | PointCloud, segmenter: Segmenter | None = None
) -> Segmentation:
    """Segment a scan into ground and clusters.

    Parameters
    ----------
    points : (n, 3+) array, object with one as its attribute ``points``, or PointCloud [m]
        Scan in the sensor frame, z roughly upwards; float32 or float64. Columns past the third are
        ignored. Rows with NaN or Inf get the label -1.
    segmenter : Segmenter, optional
        Settings; the defaults require no sensor height.

    Returns
    -------
    Segmentation
        Labels in the order of the rows of `points`. Without reliable ground no point is ground;
        see ``ground.status`` and ``ground.reason``.

    Raises
    ------
    InvalidInput
        Wrong shape or type, or no finite point.
    """
    return (segmenter or Segmenter()).segment(points)
