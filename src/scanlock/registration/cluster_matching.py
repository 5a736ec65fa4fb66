"""Pose hypotheses from clusters that look alike and stand alike to each other.

The clusters of SGC-NDT as features for the initial alignment, which Das et al. 2013 leave for
later. Matches of single clusters are mostly wrong; the right ones agree with each other about
distances, heights and headings, so large sets of matches that all agree are hardly ever wrong.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import cdist

from scanlock.arrays import Matrix, Points, Vector, read_only
from scanlock.errors import (
    InvalidInput,
    require_at_least,
    require_count,
    require_fraction,
    require_positive,
)
from scanlock.geometry.pose import Pose
from scanlock.geometry.rigid_fit import PairMoments
from scanlock.kernels.agreeing_sets import grown_sets, shared_neighbours
from scanlock.kernels.compatibility import soft_overlap
from scanlock.models.cluster_features import ClusterFeatures, PartKind
from scanlock.models.gaussians import Gaussians
from scanlock.registration.compatibility import Matches, Tolerances, agreement_graphs
from scanlock.registration.hypothesis import Hypothesis

_STANCE_TOLERANCES = np.array([0.4, 0.3, 2.0, 3.0])
"""Of `ClusterFeatures.stances`; heights change with the slope of the ground."""

_SOFTNESS = 1.5
"""Likeness falls off by this many tolerances when poses are compared: a wrong likeness costs a
count there, where it costs a match before."""

_LARGEST_SET = 64
"""Agreeing matches beyond these add nothing to a pose that is only a start."""

_LEVER = 6.0
"""Length [m] of the posts up and down that are added to the pairs of two level scans: a tilt
must be worth the effort of turning them."""

_DISTINCT = (1.0, math.radians(5.0))
"""Poses nearer than this [m] and [rad] are one hypothesis."""


@dataclass(frozen=True, kw_only=True, slots=True)
class ClusterMatcher:
    """Settings of the matching; `describe` each scan once, then `hypotheses` for any pair."""

    nearest: int = 10
    """Two parts match if each is among this many of the other's most alike."""

    nearest_free: int = 20
    """The same where a scan is not level, as shapes alone tell parts apart less well."""

    most_matches: int = 1000
    """How many matches are compared with each other, the most alike; the cost is the square."""

    most_thin: int = 600
    """How many matches of thin parts are also compared on their own where a scan is not level:
    what was not known to be ground falls into patches, all alike, that crowd out trunks."""

    size_worth: float = 0.25
    """What the logarithm of a part's size adds to its likeness, in squared tolerances, when
    matches are chosen and a scan is not level: there are few large parts."""

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

    least_distance: float = 2.0
    """Parts nearer to each other than this say nothing about a heading [m]."""

    grades: tuple[float, ...] = (1.0, 2.0, 4.0)
    """Sums of squared misfits, in tolerances, up to which two matches agree, ascending; each
    grade gives its own sets."""

    sets_a_grade: int = 8
    """How many sets of agreeing matches are tried at each grade."""

    overlap_width: float = 1.0
    """How near two parts come when they meet, a deviation [m]."""

    most: int = 8
    """How many hypotheses, at most."""

    def __post_init__(self) -> None:
        for name in ("nearest", "nearest_free", "most_matches", "sets_a_grade", "most"):
            require_count(name, getattr(self, name))
        require_count("most_thin", self.most_thin, 0)
        require_at_least("size_worth", self.size_worth, 0.0)
        for name, unit in (
            ("shape_tolerance", ""),
            ("distance_tolerance", "m"),
            ("angle_tolerance", "rad"),
            ("overlap_width", "m"),
        ):
            require_positive(name, getattr(self, name), unit)
        require_fraction("slack", self.slack)
        require_at_least("slope_tolerance", self.slope_tolerance, 0.0)
        require_positive("least_distance", self.least_distance, unit="m")
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
        unlikeness = self._unlikeness(target, source, is_level)
        affinities = read_only(np.exp(-0.5 / _SOFTNESS**2 * unlikeness))
        found: list[tuple[float, Pose]] = []
        for members in self._sets(target, source, unlikeness, is_level):
            pose = _fitted(target.centres[members.target], source.centres[members.source], is_level)
            if pose is not None:
                meeting = soft_overlap(
                    target.centres,
                    read_only(pose.apply(source.centres)),
                    affinities,
                    self.overlap_width,
                )
                found.append((meeting * math.sqrt(len(members)), pose))
        found.sort(key=lambda one: one[0], reverse=True)
        return [
            Hypothesis(_between_scans(target, source, pose), weight, "cluster matching")
            for weight, pose in _distinct(found, self.most)
        ]

    def _unlikeness(
        self, target: ClusterFeatures, source: ClusterFeatures, is_level: bool
    ) -> Matrix:
        """Return the (source, target) squared differences in tolerances, within each kind."""
        unlikeness = np.asarray(
            cdist(
                self._descriptors(source, is_level),
                self._descriptors(target, is_level),
                "sqeuclidean",
            ),
            dtype=np.float64,
        )
        unlikeness[source.kinds[:, None] != target.kinds] = np.inf
        return unlikeness

    def _descriptors(self, features: ClusterFeatures, is_level: bool) -> Matrix:
        shapes = features.shapes / self.shape_tolerance
        if not is_level:
            return shapes
        return np.concatenate([shapes, features.stances / _STANCE_TOLERANCES], axis=1)

    def _sets(
        self, target: ClusterFeatures, source: ClusterFeatures, unlikeness: Matrix, is_level: bool
    ) -> list[Matches]:
        """Return sets of matches that all agree with each other, from each grade."""
        tolerances = Tolerances(
            self.distance_tolerance,
            self.slope_tolerance,
            self.angle_tolerance,
            self.least_distance,
            self.slack,
        )
        sets: list[Matches] = []
        for matches in self._choices(target, source, unlikeness, is_level):
            for graph in agreement_graphs(
                target, source, matches, tolerances, self.grades, is_level=is_level
            ):
                pairs, shared = shared_neighbours(read_only(graph))
                order = np.argsort(-shared, kind="stable")
                grown = grown_sets(
                    read_only(graph), read_only(pairs[order]), self.sets_a_grade, _LARGEST_SET
                )
                sets += [matches.taken(row[row >= 0]) for row in grown]
        return sets

    def _choices(
        self, target: ClusterFeatures, source: ClusterFeatures, unlikeness: Matrix, is_level: bool
    ) -> list[Matches]:
        """Return the choices of matches that are compared, each within itself."""
        mutual = Matches.mutual(unlikeness, self.nearest if is_level else self.nearest_free)
        values = unlikeness[mutual.source, mutual.target]
        if is_level:
            return [mutual.least(values, self.most_matches)]
        sizes = target.shapes.sum(axis=1)[mutual.target] + source.shapes.sum(axis=1)[mutual.source]
        is_thin = source.kinds[mutual.source] == PartKind.THIN
        return [
            mutual.least(values - self.size_worth * sizes, self.most_matches),
            mutual.taken(is_thin).least(values[is_thin], self.most_thin),
        ]


def _fitted(target: Points, source: Points, is_level: bool) -> Pose | None:
    """Return the pose that carries the source centres onto those of the target."""
    if is_level:
        posts: Vector = np.array([[0.0, 0.0, _LEVER], [0.0, 0.0, -_LEVER]])
        target = np.concatenate([target, target.mean(axis=0) + posts])
        source = np.concatenate([source, source.mean(axis=0) + posts])
    moments = PairMoments.of(target, source)
    return moments.by_singular_values() if moments.holds_rotation else None


def _between_scans(target: ClusterFeatures, source: ClusterFeatures, pose: Pose) -> Pose:
    """Return target_from_source between scan frames of a pose between the features' frames."""
    if target.level_from_scan is not None:
        pose = target.level_from_scan.inverse() @ pose
    return pose if source.level_from_scan is None else pose @ source.level_from_scan


def _distinct(found: list[tuple[float, Pose]], most: int) -> list[tuple[float, Pose]]:
    """Return the first of all that lie near each other, `most` of them."""
    kept: list[tuple[float, Pose]] = []
    metres, radians = _DISTINCT
    for weight, pose in found:
        if len(kept) == most:
            break
        if not any(pose.is_close(k, translation=metres, rotation=radians) for _, k in kept):
            kept.append((weight, pose))
    return kept
