"""Pose hypotheses from clusters that look alike and stand alike to each other.

The clusters of SGC-NDT as features for the initial alignment, which Das et al. 2013 leave for
later. Matches of single clusters are mostly wrong; the right ones agree with each other about
distances, heights and headings, so large sets of matches that all agree are hardly ever wrong.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Labels, Matrix, Points, Vector, read_only
from scanlock.errors import (
    InvalidInput,
    require_at_least,
    require_count,
    require_fraction,
    require_positive,
)
from scanlock.geometry.pose import Pose
from scanlock.geometry.rigid_fit import PairMoments
from scanlock.kernels.search.cliques import grown_sets, shared_neighbours
from scanlock.kernels.search.compatibility import (
    free_compatibility,
    level_compatibility,
    soft_overlap,
)
from scanlock.models.gaussians import Gaussians
from scanlock.registration.search.cluster_features import ClusterFeatures
from scanlock.registration.search.hypothesis import Hypothesis, distinct

_STANCE_TOLERANCES = np.array([0.4, 0.3, 2.0, 3.0])
"""Of `ClusterFeatures.stances`; heights change with the slope of the ground."""

_MOST_UNLIKE = 9.0
"""Parts whose squared differences, in tolerances, sum to more are never matched."""

_SOFTNESS = 1.5
"""Likeness falls off by this many tolerances when poses are compared: a wrong likeness costs a
count there, where it costs a match before."""

_LARGEST_SET = 64
"""Agreeing matches beyond these add nothing to a pose that is only a start."""

_ROTATION_SCALE = 6.0
"""Length [m] of the posts up and down that are added to the pairs of two level scans: a tilt
must be worth the effort of turning them."""

_DISTINCT = (1.0, math.radians(5.0))
"""Poses nearer than this [m] and [rad] are one hypothesis."""


@dataclass(frozen=True, slots=True, eq=False)
class _Matches:
    """Rows of target and source that may be the same part, and how alike all parts are."""

    target: Labels
    source: Labels
    affinities: Matrix


@dataclass(frozen=True, kw_only=True, slots=True)
class ClusterMatcher:
    """Settings of the matching; `describe` each scan once, then `hypotheses` for any pair."""

    nearest: int = 10
    """Two parts match if each is among this many of the other's most alike."""

    max_matches: int = 1000
    """How many matches are compared with each other, the most alike; the cost is the square."""

    shape_tolerance: float = 0.4
    """Difference of the logarithms of deviations between two views of one part."""

    distance_tolerance: float = 0.4
    """By how much the distance of two centres may change between views [m]."""

    slack: float = 0.15
    """Share of a part's variance that is added to the square of that tolerance, along each
    direction: the centres of large parts slide with what is seen of them."""

    slope_tolerance: float = 0.1
    """Difference of heights per distance between two level scans: each is level by the ground
    around it."""

    angle_tolerance: float = 0.15
    """By how much the axes of parts may turn between views [rad]."""

    min_distance: float = 2.0
    """Parts nearer to each other than this say nothing about a heading [m]."""

    grades: tuple[float, ...] = (1.0, 2.0, 4.0)
    """Sums of squared misfits, in tolerances, up to which two matches agree, ascending; each
    grade gives its own sets."""

    sets_per_grade: int = 8
    """How many sets of agreeing matches are tried at each grade."""

    overlap_width: float = 1.0
    """How near two parts come when they meet, a deviation [m]."""

    max_hypotheses: int = 8
    """How many hypotheses, at most."""

    def __post_init__(self) -> None:
        for name in ("nearest", "max_matches", "sets_per_grade", "max_hypotheses"):
            require_count(name, getattr(self, name))
        for name, unit in (
            ("shape_tolerance", ""),
            ("distance_tolerance", "m"),
            ("angle_tolerance", "rad"),
            ("overlap_width", "m"),
        ):
            require_positive(name, getattr(self, name), unit)
        require_fraction("slack", self.slack)
        require_at_least("slope_tolerance", self.slope_tolerance, 0.0)
        require_positive("min_distance", self.min_distance, unit="m")
        for grade in self.grades:
            require_positive("grades", grade)
        if not self.grades or list(self.grades) != sorted(self.grades):
            raise InvalidInput(f"grades must be ascending and not empty, got {self.grades}")

    def describe(self, gaussians: Gaussians, level_from_scan: Pose | None) -> ClusterFeatures:
        """Return what the matching needs of a scan.

        Parameters
        ----------
        gaussians : Gaussians
            Its clusters, in its own frame.
        level_from_scan : Pose or None
            Turns the scan upright with the ground at z = 0; None where no ground was found.
        """
        return ClusterFeatures.of(gaussians, level_from_scan)

    def hypotheses(self, target: ClusterFeatures, source: ClusterFeatures) -> list[Hypothesis]:
        """Return the poses at which most clusters meet their like, best first.

        Heights and headings help where both scans are level; else any tilt is found. The weight
        is the number of parts that meet, times the root of the number of agreeing matches that
        led there. None where no three matches agree.
        """
        if len(target) == 0 or len(source) == 0:
            return []
        is_level = target.level_from_scan is not None and source.level_from_scan is not None
        matches = self._matches(target, source, is_level)
        found: list[tuple[float, Pose]] = []
        for members in self._sets(target, source, matches, is_level):
            pose = _fitted(
                target.centres[matches.target[members]],
                source.centres[matches.source[members]],
                is_level,
            )
            if pose is not None:
                meeting = soft_overlap(
                    target.centres,
                    read_only(pose.apply(source.centres)),
                    matches.affinities,
                    self.overlap_width,
                )
                found.append((meeting * math.sqrt(len(members)), pose))
        found.sort(key=lambda one: one[0], reverse=True)
        rows = distinct([pose for _, pose in found], *_DISTINCT)[: self.max_hypotheses]
        return [
            Hypothesis(_between_scans(target, source, pose), weight, "cluster matching")
            for weight, pose in (found[row] for row in rows)
        ]

    def _matches(
        self, target: ClusterFeatures, source: ClusterFeatures, is_level: bool
    ) -> _Matches:
        """Return the mutual best matches within each kind, the most alike of them."""
        from scipy.spatial.distance import cdist  # takes longer to import than it works

        source_descriptors = self._descriptors(source, is_level)
        target_descriptors = self._descriptors(target, is_level)
        unlikeness = np.asarray(
            cdist(source_descriptors, target_descriptors, "sqeuclidean"), dtype=np.float64
        )
        unlikeness[source.kinds[:, None] != target.kinds] = np.inf
        is_match = _mutually_near(unlikeness, self.nearest) & (unlikeness <= _MOST_UNLIKE)
        rows, columns = np.nonzero(is_match)
        if len(rows) > self.max_matches:
            order = np.argsort(unlikeness[rows, columns], kind="stable")[: self.max_matches]
            rows, columns = rows[order], columns[order]
        affinities = np.exp(-0.5 / _SOFTNESS**2 * unlikeness)
        return _Matches(columns, rows, read_only(affinities))

    def _descriptors(self, features: ClusterFeatures, is_level: bool) -> Matrix:
        shapes = features.shapes / self.shape_tolerance
        if not is_level:
            return shapes
        return np.concatenate([shapes, features.stances / _STANCE_TOLERANCES], axis=1)

    def _sets(
        self, target: ClusterFeatures, source: ClusterFeatures, matches: _Matches, is_level: bool
    ) -> list[Labels]:
        """Return sets of matches that all agree with each other, from each grade."""
        sets: list[Labels] = []
        for graph in self._graphs(target, source, matches, is_level):
            pairs, shared = shared_neighbours(read_only(graph))
            order = np.argsort(-shared, kind="stable")
            grown = grown_sets(
                read_only(graph), read_only(pairs[order]), self.sets_per_grade, _LARGEST_SET
            )
            sets += [row[row >= 0] for row in grown]
        return sets

    def _graphs(
        self, target: ClusterFeatures, source: ClusterFeatures, matches: _Matches, is_level: bool
    ) -> NDArray[np.uint64]:
        at, of = matches.target, matches.source
        tolerances = np.array(
            [
                self.distance_tolerance,
                self.slope_tolerance,
                self.angle_tolerance,
                self.min_distance,
            ]
        )
        grades = np.array(self.grades)
        parts = (
            read_only(target.centres[at]),
            read_only(source.centres[of]),
            read_only(self.slack * target.spreads[at]),
            read_only(self.slack * source.spreads[of]),
        )
        if is_level:
            turns = _turns(target.headings[at], source.headings[of])
            return level_compatibility(
                *parts, read_only(turns), read_only(tolerances), read_only(grades)
            )
        axes = read_only(target.axes[at]), read_only(source.axes[of])
        return free_compatibility(*parts, *axes, read_only(tolerances), read_only(grades))


def _mutually_near(distances: Matrix, nearest: int) -> NDArray[np.bool_]:
    """Tell which entries are among the `nearest` least of both their row and their column."""
    least = [
        np.partition(distances, min(nearest, distances.shape[axis]) - 1, axis=axis).take(
            [min(nearest, distances.shape[axis]) - 1], axis=axis
        )
        for axis in (0, 1)
    ]
    return (distances <= least[0]) & (distances <= least[1])


def _turns(target: Matrix, source: Matrix) -> Matrix:
    """Return cosine and sine of twice the turns from source to target headings."""
    cosines = (target * source).sum(axis=1)
    sines = target[:, 1] * source[:, 0] - target[:, 0] * source[:, 1]
    return np.stack([cosines, sines], axis=1)


def _fitted(target: Points, source: Points, is_level: bool) -> Pose | None:
    """Return the pose that carries the source centres onto those of the target."""
    if is_level:
        posts: Vector = np.array([[0.0, 0.0, _ROTATION_SCALE], [0.0, 0.0, -_ROTATION_SCALE]])
        target = np.concatenate([target, target.mean(axis=0) + posts])
        source = np.concatenate([source, source.mean(axis=0) + posts])
    moments = PairMoments.of(target, source)
    return moments.by_singular_values() if moments.constrains_rotation else None


def _between_scans(target: ClusterFeatures, source: ClusterFeatures, pose: Pose) -> Pose:
    """Return target_from_source between scan frames of a pose between the features' frames."""
    if target.level_from_scan is not None:
        pose = target.level_from_scan.inverse() @ pose
    return pose if source.level_from_scan is None else pose @ source.level_from_scan
