"""Who is paired with whom, and how much each pair counts: step 1 of Madhavan and Messina 2003."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector, frozen, read_only
from scanlock.clouds.neighbours import NearestNeighbours
from scanlock.clouds.point_tree import PointTree
from scanlock.errors import InvalidInput, require_positive
from scanlock.geometry.pose import Pose
from scanlock.optimisation.objectives.robust_weights import RobustWeights
from scanlock.registration.methods.rejection import AdaptiveRejection, Rejection

Residual = Literal["point-to-point", "point-to-plane"]
"""The distance of a pair, or its part along the normal of the target's surface."""

MIN_CORRESPONDENCES = 10
"""Of fewer points, or fewer pairs, no pose is worth the name."""

_SHELLS = 10
"""Shells of equal count about the sensor, over which the spacing of a scan is a mean."""


@dataclass(frozen=True, slots=True, eq=False)
class PointScan:
    """A scan ready to be registered by its points, as target or as source.

    Attributes
    ----------
    closest : NearestNeighbours
        The points that are paired, thinned or all, and the way to search them.
    spacing : float [m]
        Typical distance between neighbours among them, see `typical_spacing`.
    normals : (n, 3)
        Unit normals of the surface around each; (0, 3) where the settings need none.
    covariances : (n, 6) [m^2]
        Of the sensor's noise at each, packed; (0, 6) without a noise model.
    sample : (k, 3) [m]
        What the search for a start looks up; (0, 3) without such a search.
    """

    closest: NearestNeighbours
    spacing: float
    normals: Points
    covariances: Matrix
    sample: Points

    def __post_init__(self) -> None:
        for array in (self.normals, self.covariances, self.sample):
            frozen(array)

    @property
    def points(self) -> Points:
        """(n, 3) the points that are paired [m]."""
        return self.closest.points


@dataclass(frozen=True, slots=True, eq=False)
class Correspondences:
    """The pairs of one iteration that count.

    Attributes
    ----------
    target_rows, source_rows : (m,)
        Pair i is of these rows.
    weights : (m,)
        Robust weights, in [0, 1].
    mean_distance : float [m]
        Mean distance of these pairs, whatever their weights; NaN without pairs.
    limit : float [m]
        No pair farther apart was kept.
    """

    target_rows: Labels
    source_rows: Labels
    weights: Vector
    mean_distance: float
    threshold: float

    def __post_init__(self) -> None:
        for array in (self.target_rows, self.source_rows, self.weights):
            frozen(array)

    def __len__(self) -> int:
        return len(self.target_rows)

    @property
    def effective(self) -> int:
        """How many of the pairs have any weight."""
        return int(np.count_nonzero(self.weights))


@dataclass(frozen=True, kw_only=True, slots=True)
class CorrespondenceFinder:
    """Settings that pair the points of two scans at a pose."""

    rejection: Rejection = field(default_factory=AdaptiveRejection)
    """Pairs too far apart are dropped."""

    max_correspondence_distance: float = 10.0
    """Points without another within this distance are not paired at all, and enter no
    statistics [m]; infinite in the paper."""

    max_normal_angle: float | None = None
    """Pairs whose surfaces differ by more than this angle are dropped [rad]; None asks nothing.
    Zhang 1994 advises 60 degrees."""

    robust: RobustWeights = field(default_factory=RobustWeights)
    """How the weight of a pair falls with its residual; 1 for all by default, as in the paper."""

    def __post_init__(self) -> None:
        if self.max_correspondence_distance != np.inf:
            require_positive(
                "max_correspondence_distance", self.max_correspondence_distance, unit="m"
            )
        if self.max_normal_angle is not None and not 0.0 < self.max_normal_angle <= np.pi / 2:
            raise InvalidInput(
                "orientation must lie between 0 and pi/2, for normals have no sign, got "
                f"{self.max_normal_angle} rad"
            )

    def find(
        self,
        target: PointScan,
        source: PointScan,
        pose: Pose,
        previous: float,
        most: float,
        residual: Residual,
    ) -> Correspondences:
        """Return the pairs that count at a pose.

        Parameters
        ----------
        target, source : PointScan
        pose : Pose
            Target from source.
        previous : float [m]
            The limit of the iteration before; infinite until there is one to heed.
        most : float [m]
            The limit may not be larger, whatever the gate says.
        residual : str
            What the robust weights look at.
        """
        moved = pose.apply(source.points)
        partners, distances = target.closest.nearest(
            moved, min(self.max_correspondence_distance, self.rejection.max_distance)
        )
        met = np.flatnonzero(partners >= 0)
        if not len(met):
            nobody = read_only(np.zeros(0, np.int64))
            return Correspondences(nobody, nobody, np.zeros(0), np.nan, previous)
        limit = min(self.rejection.threshold(distances[met], previous, target.spacing), most)
        rows = met[distances[met] <= limit]
        if self.max_normal_angle is not None:
            turned = source.normals[rows] @ pose.rotation.T
            cosines = np.einsum("ma,ma->m", turned, target.normals[partners[rows]])
            rows = rows[np.abs(cosines) >= np.cos(self.max_normal_angle)]
        return self._weighed(target, moved, partners, distances, rows, limit, residual)

    def _weighed(
        self,
        target: PointScan,
        moved: Points,
        partners: Labels,
        distances: Vector,
        rows: Labels,
        limit: float,
        residual: Residual,
    ) -> Correspondences:
        residuals = distances[rows]
        mean = float(residuals.mean()) if len(rows) else np.nan
        if residual == "point-to-plane":
            gaps = moved[rows] - target.points[partners[rows]]
            residuals = np.einsum("ma,ma->m", gaps, target.normals[partners[rows]])
        weights = self.robust.weights(residuals) if len(rows) else np.zeros(0)
        return Correspondences(read_only(partners[rows]), read_only(rows), weights, mean, limit)


def typical_spacing(tree: PointTree) -> float:
    """Return the typical distance between neighbouring points [m].

    The mean, over ten shells of equal count about the sensor, of the median distance of a point
    to the nearest other. A scan is dense near the sensor and sparse far away: the median over all
    points would speak of the near ones only, and the mean of strays.
    """
    if len(tree) < 2:
        return 0.0
    other = tree.points[tree.neighbours(2)[:, 1]]
    spacings = np.linalg.norm(tree.points - other, axis=1)
    order = np.argsort(np.linalg.norm(tree.points, axis=1))
    shells = np.array_split(spacings[order], min(_SHELLS, len(tree)))
    return float(np.mean([np.median(shell) for shell in shells]))
