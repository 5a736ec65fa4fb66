"""Dominant planes of a cloud at any attitude, as candidates for its ground.

The score is that of the base plane: it increases with points on a plane and decreases with points
below it. Outdoors the ground has nearly twice the score of the best facade, since it is nearer to
the sensor and all around it. Between the walls of a corridor it can have the lower one.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from scanlock.arrays import Labels, Points, Vector, frozen, read_only
from scanlock.clouds.voxel_grid import voxel_means
from scanlock.geometry.rotations import rotation_onto_z
from scanlock.kernels.ground.dominant_planes import scored_triples
from scanlock.kernels.ground.plane import refined_plane
from scanlock.segmentation.ground.plane import (
    THRESHOLD,
    THRESHOLD_FACTORS,
    THRESHOLD_SLOPE,
    WEIGHT_RANGE,
)

_MAX_POINTS = 20_000
"""Number of points of the cloud that are downsampled (ours)."""

_VOXEL_SIZE = 0.5
"""Side of the voxels [m]: a surface counts by its area, not by its points (ours)."""

_TRIPLES, _SCORED = 2000, 700
"""Number of candidate planes, and of the points that score each (ours).

If a sixth of the points are ground, nine candidates are fits to ground points only.
"""

_MAX_PLANES = 6
"""Maximum number of planes (ours)."""

_MIN_COSINE = math.cos(math.radians(30.0))
"""Cosine of the smallest angle between the normals of two planes (ours)."""

_SAME_OFFSET = 0.5
"""Difference of the offsets of one plane and of its other side [m] (ours)."""

_GOLDEN_RATIO = 0.5 * (math.sqrt(5.0) - 1.0)
_SEQUENCE_STEPS = 1.2207440846057596 ** -np.array([1.0, 2.0, 3.0])
"""Steps of the R3 sequence: powers of the root of x**4 = x + 1."""


class ScoredPlane(NamedTuple):
    """Plane ``normal . p + offset = 0``, and its score as the ground."""

    normal: Vector
    offset: float
    score: float

    def is_other_side_of(self, other: "ScoredPlane") -> bool:
        """Return whether this is the other plane, upside down."""
        is_opposite = float(self.normal @ other.normal) < -_MIN_COSINE
        return is_opposite and abs(self.offset + other.offset) < _SAME_OFFSET


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceSample:
    """Sample of the surfaces of a cloud, evenly distributed.

    Attributes
    ----------
    points : (n, 3) [m]
        Means of voxels, in quasi-random order.
    weights : (n,)
        Weights ``1 / (r + r_0)`` at range r, as for the base plane; they sum to one.
    inverse_thresholds : (n,) [1/m]
        Inverses of the distances within which a point is on a plane.
    """

    points: Points
    weights: Vector
    inverse_thresholds: Vector

    def __post_init__(self) -> None:
        for array in (self.points, self.weights, self.inverse_thresholds):
            frozen(array)

    @classmethod
    def of(cls, points: Points) -> "SurfaceSample":
        """Sample the surfaces of (n, 3) points [m]."""
        step = max(1, len(points) // _MAX_POINTS)
        means = voxel_means(np.ascontiguousarray(points[::step]), _VOXEL_SIZE)
        # In this order any first part of the voxels is spread over all of them.
        means = means[np.argsort(np.arange(len(means)) * _GOLDEN_RATIO % 1.0, kind="stable")]
        ranges = np.sqrt((means * means).sum(axis=1))
        weights = 1.0 / (ranges + WEIGHT_RANGE)
        return cls(means, weights / weights.sum(), 1.0 / (THRESHOLD + THRESHOLD_SLOPE * ranges))

    def score(self, normal: Vector, offset: float) -> float:
        """Return the score of a plane as the ground, that of the kernel `plane_score`."""
        residuals = (self.points @ normal + offset) * self.inverse_thresholds
        beneath = np.where(residuals < -2.0, -0.5, 0.0)
        return float(self.weights @ np.maximum(1.0 - residuals**2, beneath))

    def dominant_planes(self) -> list[ScoredPlane]:
        """Return distinct planes with positive scores, best first; deterministic."""
        if len(self.points) < 3:
            return []
        columns = self._columns(self.points)
        candidates = scored_triples(*columns, self._triples(), min(_SCORED, len(self.points)))
        candidates = candidates[candidates[:, 4] > 0.0]
        candidates = candidates[np.argsort(-candidates[:, 4], kind="stable")]
        refined: list[ScoredPlane] = []
        while len(candidates) and len(refined) < _MAX_PLANES:
            normal = candidates[0, :3]
            refined += self._refined(normal, float(candidates[0, 3]))
            candidates = candidates[candidates[:, :3] @ normal < _MIN_COSINE]
        refined.sort(key=lambda one: one.score, reverse=True)
        return _distinct(refined)

    def _triples(self) -> Labels:
        """Return (t, 3) rows of points, those of large weights more often."""
        steps = np.arange(1, _TRIPLES + 1)[:, None] * _SEQUENCE_STEPS
        cumulated = np.cumsum(self.weights)
        rows = np.searchsorted(cumulated, (0.5 + steps) % 1.0 * cumulated[-1], side="right")
        return read_only(np.minimum(rows, len(cumulated) - 1))

    def _refined(self, normal: Vector, offset: float) -> list[ScoredPlane]:
        """Return the plane after reweighted fits; none if no point is near it."""
        levelling = rotation_onto_z(normal)
        columns = self._columns(self.points @ levelling.T)
        nx, ny, nz, d, score = refined_plane(*columns, THRESHOLD_FACTORS, 0.0, 0.0, 1.0, offset)
        if score <= 0.0:
            return []
        return [ScoredPlane(levelling.T @ np.array([nx, ny, nz]), d, score)]

    def _columns(self, points: Points) -> tuple[Vector, Vector, Vector, Vector, Vector]:
        """Return x, y, z, weights and inverse thresholds."""
        x, y, z = (read_only(np.ascontiguousarray(points[:, axis])) for axis in range(3))
        return x, y, z, self.weights, self.inverse_thresholds


def _distinct(planes: list[ScoredPlane]) -> list[ScoredPlane]:
    """Return the planes whose normals differ from those of all better ones."""
    distinct: list[ScoredPlane] = []
    for one in planes:
        if all(float(one.normal @ other.normal) < _MIN_COSINE for other in distinct):
            distinct.append(one)
    return distinct
