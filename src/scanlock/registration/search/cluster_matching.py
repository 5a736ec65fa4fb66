"""Cluster matching: pose hypotheses from pairwise consistent matches of clusters.

Das et al. 2013 leave the initial alignment by cluster features for future work; Qiao et al. 2023
(G3Reg) do it with ellipsoids and cliques. Most single matches are wrong. Correct ones are
consistent with each other in distances, heights and headings, so large cliques of consistent
matches are hardly ever wrong.
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
from scanlock.kernels.search.cliques import greedy_cliques, shared_neighbours
from scanlock.kernels.search.compatibility import (
    free_compatibility,
    level_compatibility,
    soft_overlap,
)
from scanlock.models.gaussians import Gaussians
from scanlock.registration.search.cluster_features import ClusterFeatures
from scanlock.registration.search.hypothesis import Hypothesis, distinct_rows

_VERTICAL_TOLERANCES = np.array([0.4, 0.3, 2.0, 3.0])
"""Tolerances of `ClusterFeatures.vertical_features`; heights change with the slope of the
ground."""

_MAX_DISSIMILARITY = 9.0
"""Maximum sum of squared feature differences, in tolerances, of two matched clusters."""

_AFFINITY_DEVIATION = 1.5
"""Standard deviation of the affinity over the feature difference, in tolerances. It is wider than
the tolerances: in the overlap a wrong affinity changes one term only."""

_MAX_CLIQUE_SIZE = 64
"""Maximum number of matches in a clique; a coarse pose needs no more."""

_VERTICAL_OFFSET = 6.0
"""Offset [m] above and below the centroid of two virtual correspondences between level scans.
They regularise roll and pitch."""

_MIN_SEPARATION = (1.0, math.radians(5.0))
"""Minimum difference in translation [m] or rotation [rad] between two hypotheses."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _Matches:
    """Candidate matches of clusters.

    Attributes
    ----------
    target, source : (m,)
        Rows of the matched clusters.
    affinities : (source clusters, target clusters)
        Similarity of any two clusters, 0 to 1.
    """

    target: Labels
    source: Labels
    affinities: Matrix


@dataclass(frozen=True, kw_only=True, slots=True)
class ClusterMatcher:
    """Settings of the matching: `describe` each scan once, then `hypotheses` of any pair."""

    nearest: int = 10
    """Two clusters match if each is among this number of nearest neighbours of the other in
    feature space."""

    max_clusters: int = 2000
    """Maximum number of clusters of a scan, those of the most points first. Memory is quadratic;
    scans of vehicles have a few hundred clusters, without a ground up to 1700."""

    max_matches: int = 1000
    """Maximum number of matches, most similar first; the cost is quadratic."""

    shape_tolerance: float = 0.4
    """Tolerance of the logarithm of a principal deviation between two views."""

    distance_tolerance: float = 0.4
    """Tolerance of the distance between two cluster centres between views [m]."""

    centre_variance_ratio: float = 0.15
    """Variance of a cluster's centre between views as a fraction of the cluster's covariance. The
    centre of a large cluster depends on the observed part."""

    slope_tolerance: float = 0.1
    """Tolerance of a height difference per distance between two level scans: each is levelled by
    the ground around it."""

    angle_tolerance: float = 0.15
    """Tolerance of the axis of a cluster between views [rad]."""

    min_distance: float = 2.0
    """Minimum distance between the clusters of two compared matches [m]; closer ones do not
    constrain the heading."""

    consistency_thresholds: tuple[float, ...] = (1.0, 2.0, 4.0)
    """Maximum sums of squared misfits, in tolerances, of two consistent matches, ascending. Each
    threshold defines a compatibility graph with its own cliques."""

    max_cliques: int = 8
    """Maximum number of cliques of each compatibility graph."""

    overlap_deviation: float = 1.0
    """Standard deviation of the distance of overlapping clusters in the score of a pose [m]."""

    max_hypotheses: int = 8
    """Maximum number of hypotheses."""

    def __post_init__(self) -> None:
        for name in ("nearest", "max_clusters", "max_matches", "max_cliques", "max_hypotheses"):
            require_count(name, getattr(self, name))
        for name, unit in (
            ("shape_tolerance", ""),
            ("distance_tolerance", "m"),
            ("angle_tolerance", "rad"),
            ("overlap_deviation", "m"),
        ):
            require_positive(name, getattr(self, name), unit)
        require_fraction("centre_variance_ratio", self.centre_variance_ratio)
        require_at_least("slope_tolerance", self.slope_tolerance, 0.0)
        require_positive("min_distance", self.min_distance, unit="m")
        thresholds = self.consistency_thresholds
        for threshold in thresholds:
            require_positive("consistency_thresholds", threshold)
        if not thresholds or list(thresholds) != sorted(thresholds):
            raise InvalidInput(
                f"consistency_thresholds must be ascending and not empty, got {thresholds}"
            )

    def describe(self, gaussians: Gaussians, level_from_scan: Pose | None) -> ClusterFeatures:
        """Compute the features of the clusters of a scan.

        Parameters
        ----------
        gaussians : Gaussians
            The clusters, in the frame of the scan.
        level_from_scan : Pose or None
            Pose of the scan in its levelled frame; None if no ground was found.
        """
        largest = gaussians.with_most_points(self.max_clusters)
        return ClusterFeatures.from_gaussians(largest, level_from_scan)

    def hypotheses(self, target: ClusterFeatures, source: ClusterFeatures) -> list[Hypothesis]:
        """Return the poses of the cliques, best first.

        Between two level scans heights and headings are compared too; otherwise the search is
        invariant to rotations. The score is the soft number of overlapping similar clusters times
        the root of the clique size. The list is empty if no three matches are consistent.
        """
        if len(target) == 0 or len(source) == 0:
            return []
        is_level = target.level_from_scan is not None and source.level_from_scan is not None
        matches = self._matches(target, source, is_level)
        scored: list[tuple[float, Pose]] = []
        for clique in self._cliques(target, source, matches, is_level):
            pose = _estimate_pose(
                target.centres[matches.target[clique]],
                source.centres[matches.source[clique]],
                is_level,
            )
            if pose is not None:
                score = self._overlap(target, source, matches, pose) * math.sqrt(len(clique))
                scored.append((score, pose))
        scored.sort(key=lambda one: one[0], reverse=True)
        rows = distinct_rows([pose for _, pose in scored], *_MIN_SEPARATION)
        return [
            Hypothesis(
                pose=_between_scans(target, source, pose),
                score=score,
                proposed_by="cluster matching",
            )
            for score, pose in (scored[row] for row in rows[: self.max_hypotheses])
        ]

    def _overlap(
        self, target: ClusterFeatures, source: ClusterFeatures, matches: _Matches, pose: Pose
    ) -> float:
        """Return the soft number of source clusters that overlap a similar target cluster."""
        return soft_overlap(
            target.centres,
            read_only(pose.apply(source.centres)),
            matches.affinities,
            self.overlap_deviation,
        )

    def _matches(
        self, target: ClusterFeatures, source: ClusterFeatures, is_level: bool
    ) -> _Matches:
        """Return the mutual nearest neighbours in feature space of each kind."""
        from scipy.spatial.distance import cdist  # slow to import

        dissimilarity = np.asarray(
            cdist(
                self._feature_vectors(source, is_level),
                self._feature_vectors(target, is_level),
                "sqeuclidean",
            ),
            dtype=np.float64,
        )
        dissimilarity[source.kinds[:, None] != target.kinds] = np.inf
        is_match = _mutual_neighbours(dissimilarity, self.nearest)
        is_match &= dissimilarity <= _MAX_DISSIMILARITY
        rows, columns = np.nonzero(is_match)
        if len(rows) > self.max_matches:
            order = np.argsort(dissimilarity[rows, columns], kind="stable")[: self.max_matches]
            rows, columns = rows[order], columns[order]
        affinities = np.exp(-0.5 / _AFFINITY_DEVIATION**2 * dissimilarity)
        return _Matches(target=columns, source=rows, affinities=read_only(affinities))

    def _feature_vectors(self, features: ClusterFeatures, is_level: bool) -> Matrix:
        """Return the feature vector of each cluster in units of the tolerances."""
        shapes = features.log_deviations / self.shape_tolerance
        if not is_level:
            return shapes
        return np.concatenate([shapes, features.vertical_features / _VERTICAL_TOLERANCES], axis=1)

    def _cliques(
        self, target: ClusterFeatures, source: ClusterFeatures, matches: _Matches, is_level: bool
    ) -> list[Labels]:
        """Grow cliques greedily in the compatibility graph of each consistency threshold.

        Starts from the consistent pairs of matches that share the most neighbours.
        """
        cliques: list[Labels] = []
        for graph in self._compatibility_graphs(target, source, matches, is_level):
            edges, shared = shared_neighbours(read_only(graph))
            order = np.argsort(-shared, kind="stable")
            grown = greedy_cliques(
                read_only(graph), read_only(edges[order]), self.max_cliques, _MAX_CLIQUE_SIZE
            )
            cliques += [row[row >= 0] for row in grown]
        return cliques

    def _compatibility_graphs(
        self, target: ClusterFeatures, source: ClusterFeatures, matches: _Matches, is_level: bool
    ) -> NDArray[np.uint64]:
        """Return the graph of consistent matches of each threshold, as bits of words."""
        at, of = matches.target, matches.source
        tolerances = np.array(
            [
                self.distance_tolerance,
                self.slope_tolerance,
                self.angle_tolerance,
                self.min_distance,
            ]
        )
        thresholds = np.array(self.consistency_thresholds)
        clusters = (
            read_only(target.centres[at]),
            read_only(source.centres[of]),
            read_only(self.centre_variance_ratio * target.covariances[at]),
            read_only(self.centre_variance_ratio * source.covariances[of]),
        )
        if is_level:
            turns = _doubled_turns(target.headings[at], source.headings[of])
            return level_compatibility(
                *clusters, read_only(turns), read_only(tolerances), read_only(thresholds)
            )
        axes = read_only(target.axes[at]), read_only(source.axes[of])
        return free_compatibility(*clusters, *axes, read_only(tolerances), read_only(thresholds))


def _mutual_neighbours(distances: Matrix, count: int) -> NDArray[np.bool_]:
    """Return which entries are among the `count` smallest of both their row and their column."""
    limits = [
        np.partition(distances, min(count, distances.shape[axis]) - 1, axis=axis).take(
            [min(count, distances.shape[axis]) - 1], axis=axis
        )
        for axis in (0, 1)
    ]
    return (distances <= limits[0]) & (distances <= limits[1])


def _doubled_turns(target: Matrix, source: Matrix) -> Matrix:
    """Return cosine and sine of twice the angle from source to target headings."""
    cosines = (target * source).sum(axis=1)
    sines = target[:, 1] * source[:, 0] - target[:, 0] * source[:, 1]
    return np.stack([cosines, sines], axis=1)


def _estimate_pose(target: Points, source: Points, is_level: bool) -> Pose | None:
    """Estimate the pose between corresponding centres in closed form; None on a line."""
    if is_level:
        offsets: Vector = np.array([[0.0, 0.0, _VERTICAL_OFFSET], [0.0, 0.0, -_VERTICAL_OFFSET]])
        target = np.concatenate([target, target.mean(axis=0) + offsets])
        source = np.concatenate([source, source.mean(axis=0) + offsets])
    moments = PairMoments.of(target, source)
    return moments.by_singular_values() if moments.constrains_rotation else None


def _between_scans(target: ClusterFeatures, source: ClusterFeatures, pose: Pose) -> Pose:
    """Return a pose between the frames of the features as one between the frames of the scans."""
    if target.level_from_scan is not None:
        pose = target.level_from_scan.inverse() @ pose
    return pose if source.level_from_scan is None else pose @ source.level_from_scan
