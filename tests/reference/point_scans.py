"""Scans ready for ICP, made by hand: their points stay in the caller's order."""

from dataclasses import dataclass, field

import numpy as np

from reference import point_tree
from scanlock.arrays import read_only
from scanlock.clouds.point_cloud import PointCloud
from scanlock.registration.methods.correspondences import PointScan


@dataclass(frozen=True)
class SlowSearch:
    """Closest points by all distances."""

    points: np.ndarray

    def nearest(self, queries, limit=np.inf):
        return point_tree.nearest(self.points, queries, limit)


@dataclass
class SpyingGate:
    """A gate that keeps what it is asked, and answers limits in turn, the last for ever."""

    limits: tuple
    reach: float = np.inf
    distances: list = field(default_factory=list)
    previous: list = field(default_factory=list)
    spacings: list = field(default_factory=list)

    def limit(self, distances, previous, spacing):
        self.distances.append(distances)
        self.previous.append(previous)
        self.spacings.append(spacing)
        return self.limits[min(len(self.previous), len(self.limits)) - 1]

    def note(self, spacing):
        return f"spied at {spacing:g} m"


def point_scan(points, normals=None, covariances=None, spacing=1.0, closest=None):
    """A scan of (n, 3) points, with (n, 3) normals and (n, 6) covariances where given."""
    points = read_only(points)
    return PointScan(
        PointCloud.from_array(points),
        closest or SlowSearch(points),
        spacing,
        np.zeros((0, 3)) if normals is None else np.array(normals, np.float64),
        np.zeros((0, 6)) if covariances is None else np.array(covariances, np.float64),
        np.zeros((0, 3)),
        (),
        {},
    )


def unit_vectors(rng, count):
    """Random directions."""
    vectors = rng.normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1)[:, None]
