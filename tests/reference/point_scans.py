"""Scans prepared for ICP from given arrays, with their points in the order of the caller."""

from dataclasses import dataclass, field

import numpy as np

from reference import point_tree
from scanlock.arrays import read_only
from scanlock.registration.methods.icp.correspondences import PointScan


@dataclass(frozen=True)
class BruteForceSearch:
    """Nearest points by all distances."""

    points: np.ndarray

    def nearest(self, queries, max_distance=np.inf):
        return point_tree.nearest(self.points, queries, max_distance)


@dataclass
class RecordingRejection:
    """A rejection that records its arguments and returns given thresholds, then the last one."""

    thresholds: tuple
    max_distance: float = np.inf
    distances: list = field(default_factory=list)
    previous: list = field(default_factory=list)
    spacings: list = field(default_factory=list)

    def threshold(self, distances, previous, spacing):
        self.distances.append(distances)
        self.previous.append(previous)
        self.spacings.append(spacing)
        return self.thresholds[min(len(self.previous), len(self.thresholds)) - 1]

    def note(self, spacing):
        return f"recorded at {spacing:g} m"


def point_scan(points, normals=None, covariances=None, spacing=1.0, closest=None):
    """A scan of (n, 3) points, with optional (n, 3) normals and (n, 6) covariances."""
    return PointScan(
        closest or BruteForceSearch(read_only(points)),
        spacing,
        np.zeros((0, 3)) if normals is None else np.array(normals, np.float64),
        np.zeros((0, 6)) if covariances is None else np.array(covariances, np.float64),
        np.zeros((0, 3)),
    )


def unit_vectors(rng, count):
    """Random directions."""
    vectors = rng.normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1)[:, None]
