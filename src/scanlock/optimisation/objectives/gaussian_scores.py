"""NDT scores over all Gaussians: rho and Lambda of Das et al. 2013, sections VI and VII."""

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector, read_only
from scanlock.errors import InvalidInput, require_positive
from scanlock.geometry.pose import Pose
from scanlock.kernels.gaussians.d2d import d2d_terms, d2d_terms_by_run
from scanlock.kernels.gaussians.p2d import bounding_balls, p2d_terms
from scanlock.kernels.points.morton import morton_codes
from scanlock.models.gaussians import Gaussians
from scanlock.optimisation.objectives.associations import Association, Lists
from scanlock.optimisation.objectives.neighbour_lists import NeighbourLists, NeighbourSearch
from scanlock.optimisation.solvers.problem import (
    Contributions,
    Curvature,
    Quadratic,
    contributions_of_rows,
)
from scanlock.threads import parallel_map

_CACHED = "_neighbour_lists"
"""Name under which an objective caches the neighbour lists of its last pose."""


@dataclass(frozen=True, kw_only=True, slots=True)
class ScoreShape:
    """Score of one pair as a function of its squared Mahalanobis distance s.

    The score is ``-height exp(-sharpness s / 2)`` times a window. The window is 1 up to
    `window_start` and falls to 0 at `window_end` with two continuous derivatives, so that leaving
    out the pairs beyond changes neither the value nor its derivatives.
    """

    sharpness: float = 1.0
    """Factor of the squared distance: 1 in the paper, 0.05 in Stoyanov's published code. Smaller
    values enlarge the basin of convergence."""

    height: float = 1.0
    """Score of a perfect pair. It scales the whole value: it moves no minimum, but sets the weight
    of the scans against a prior, and the size of a gradient."""

    window_start: float = 16.0
    """Squared distance, times the sharpness, at which the window starts to fall; the score there
    is e^-8 of the height."""

    window_end: float = 25.0
    """Squared distance, times the sharpness, from which the score is 0."""

    def __post_init__(self) -> None:
        require_positive("sharpness", self.sharpness)
        require_positive("height", self.height)
        require_positive("window_start", self.window_start)
        if not self.window_end > self.window_start:
            raise InvalidInput(
                f"window_end must be above window_start = {self.window_start}, "
                f"got {self.window_end}"
            )

    @classmethod
    def magnusson(cls, width: float, outlier_ratio: float = 0.55) -> "ScoreShape":
        """Return the Gaussian approximation of the log likelihood of a cell with outliers.

        A point of a cell comes from its Gaussian or, with the probability `outlier_ratio`, from a
        uniform distribution over the cell: ``-log(c1 exp(-s / 2) + c2)``. The shape agrees with
        that at s = 0, at s = 1 and far away; in Magnusson 2009, equation 6.8, the height is
        ``-d1`` and the sharpness ``d2``. The window starts at e^-8 of the height, as by default.

        Parameters
        ----------
        width : float [m]
            Side of the cells.
        outlier_ratio : float
            Ratio of the outliers, above 0 and below 1; 0.55 in the Point Cloud Library.
        """
        require_positive("width", width, unit="m")
        if not 0.0 < outlier_ratio < 1.0:
            raise InvalidInput(f"outlier_ratio must lie above 0 and below 1, got {outlier_ratio}")
        # c1 / c2: density of a point at the mean under the Gaussian over that of an outlier.
        odds = 10.0 * (1.0 - outlier_ratio) * width**3 / outlier_ratio
        height = math.log1p(odds)
        at_one = math.log1p(odds * math.exp(-0.5))
        return cls(sharpness=-2.0 * math.log(at_one / height), height=height)

    @property
    def parameters(self) -> tuple[float, float, float]:
        """Sharpness, and the squared distances at which the window starts and ends."""
        return (
            self.sharpness,
            self.window_start / self.sharpness,
            self.window_end / self.sharpness,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class GaussiansToGaussians:
    """D2D score: every Gaussian of the source against every Gaussian of the target.

    The value is minus the sum over all pairs of ``w_i w_j rho``. The weights of either side are
    the counts to the power `weight_power`, scaled to unit length. The value is symmetric under
    exchange of the scans, unless `candidates` are chosen for the source.

    Attributes
    ----------
    target, source : Gaussians
        Each in the frame of its scan [m].
    shape : ScoreShape
    weight_power : float
        Power of the counts in the weights; 0 for equal weights.
    curvature : str
        Exact Hessian, or its convex part.
    candidates : Association or None
        Association rule that chooses the pairs; None for all pairs.
    """

    target: Gaussians
    source: Gaussians
    shape: ScoreShape = field(default_factory=ScoreShape)
    weight_power: float = 0.5
    curvature: Curvature = "exact"
    candidates: Association | None = None

    @property
    def count(self) -> int:
        """Number of Gaussians of the source."""
        return len(self.source)

    def linearise(self, pose: Pose) -> Quadratic:
        """Return value, gradient and Hessian at `pose`."""
        if self.candidates is not None:
            lists = self.candidates.at(pose.apply(self.source.means))
            terms = self._terms(pose, slice(None), lists)
        else:
            near = self._neighbours_at(pose)
            by_chunk = parallel_map(
                lambda chunk: self._terms(pose, near.rows(chunk), near.lists(chunk)), near.chunks
            )
            terms = by_chunk[0] if len(by_chunk) == 1 else np.sum([np.zeros(28), *by_chunk], axis=0)
        return Quadratic.from_terms(self.shape.height * terms)

    @property
    def positions(self) -> Points:
        """Means of the source."""
        return self.source.means

    @property
    def is_continuous(self) -> bool:
        """True: the window of the score has no jump."""
        return True

    def contributions(self, pose: Pose, blocks: Labels) -> Contributions:
        """Return the gradient and Hessian of each block of source Gaussians at `pose`."""
        if self.candidates is not None:
            lists, starts, members = self.candidates.at(pose.apply(self.source.means))
        else:
            lists, starts, members = self._neighbours_at(pose).all_lists()
        order = np.argsort(blocks, kind="stable")
        of_target, of_source = self._weights
        terms = d2d_terms_by_run(
            self.target.means,
            self.target.packed_covariances,
            of_target,
            read_only(self.source.means[order]),
            read_only(self.source.packed_covariances[order]),
            read_only(of_source[order]),
            read_only(lists[order]),
            starts,
            members,
            read_only(np.cumsum(np.bincount(blocks))),
            pose.rotation,
            pose.translation,
            *self.shape.parameters,
            float(self.curvature == "exact"),
        )
        return Contributions.from_terms(self.shape.height * terms)

    @cached_property
    def _weights(self) -> tuple[Vector, Vector]:
        return self.target.weights(self.weight_power), self.source.weights(self.weight_power)

    def _terms(self, pose: Pose, rows: slice, lists: Lists) -> Vector:
        of_target, of_source = self._weights
        return d2d_terms(
            self.target.means,
            self.target.packed_covariances,
            of_target,
            self.source.means[rows],
            self.source.packed_covariances[rows],
            of_source[rows],
            *lists,
            pose.rotation,
            pose.translation,
            *self.shape.parameters,
            float(self.curvature == "exact"),
        )

    @cached_property
    def _search(self) -> NeighbourSearch:
        _, _, window_end = self.shape.parameters
        return NeighbourSearch(self.target, self.source, window_end)

    def _neighbours_at(self, pose: Pose) -> NeighbourLists:
        near: NeighbourLists | None = self.__dict__.get(_CACHED)
        if near is None or not near.are_valid_at(pose):
            near = NeighbourLists(self._search, pose)
            # A cache behind a frozen class: values are the same whatever it holds.
            self.__dict__[_CACHED] = near
        return near


@dataclass(frozen=True, kw_only=True, eq=False)
class PointsToGaussians:
    """P2D score: every point of the source against every Gaussian of the target.

    The value is minus the mean over the points of the sum over the Gaussians of ``rho``, the
    cost Lambda of the paper divided by the number of points.

    Attributes
    ----------
    target : Gaussians
        In the target's frame [m].
    points : (n, 3) [m]
        Points of the source, in its frame.
    shape : ScoreShape
    curvature : str
        Exact Hessian, or its convex part.
    """

    target: Gaussians
    points: Points
    shape: ScoreShape = field(default_factory=ScoreShape)
    curvature: Curvature = "exact"

    @property
    def count(self) -> int:
        """Number of points of the source."""
        return len(self.points)

    @property
    def positions(self) -> Points:
        """Points of the source."""
        return self.points

    def linearise(self, pose: Pose) -> Quadratic:
        """Return value, gradient and Hessian at `pose`."""
        return Quadratic.from_terms(self._terms(pose, *self._sorted_points))

    @property
    def is_continuous(self) -> bool:
        """True: the window of the score has no jump."""
        return True

    def contributions(self, pose: Pose, blocks: Labels) -> Contributions:
        """Return the contribution of each block of points to gradient and Hessian at `pose`."""

        def terms(points: Points) -> Vector:
            return self._terms(pose, points, bounding_balls(points))

        return contributions_of_rows(blocks, [self.points], terms)

    def _terms(self, pose: Pose, points: Points, balls: Matrix) -> Vector:
        terms = p2d_terms(
            points,
            read_only(balls),
            self._rows,
            pose.rotation,
            pose.translation,
            *self.shape.parameters,
            float(self.curvature == "exact"),
        )
        return self.shape.height / max(1, self.count) * terms

    @cached_property
    def _sorted_points(self) -> tuple[Points, Matrix]:
        """The points in Morton order, and the bounding balls of short runs of them."""
        order = np.argsort(morton_codes(read_only(self.points)))
        points = read_only(self.points[order])
        return points, read_only(bounding_balls(points))

    @cached_property
    def _rows(self) -> Matrix:
        """The (k, 10) means, packed precisions and cut-off distances [m] of the Gaussians."""
        _, _, window_end = self.shape.parameters
        rows = np.empty((len(self.target), 10))
        rows[:, :3] = self.target.means
        rows[:, 3:9] = self.target.packed_precisions
        rows[:, 9] = np.sqrt(window_end * self.target.max_variances)
        return read_only(rows)
