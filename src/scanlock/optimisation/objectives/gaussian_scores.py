"""The scores of NDT over all Gaussians: rho and Lambda of Das et al. 2013, sections VI, VII."""

import math
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector, read_only
from scanlock.errors import InvalidInput, require_positive
from scanlock.geometry.pose import Pose
from scanlock.kernels.gaussians.d2d import d2d_terms
from scanlock.kernels.gaussians.p2d import p2d_terms, point_balls
from scanlock.kernels.points.morton import morton_codes
from scanlock.models.gaussians import Gaussians
from scanlock.optimisation.objectives.candidates import Association, Lists
from scanlock.optimisation.objectives.neighbour_lists import NeighbourLists, Reach
from scanlock.optimisation.solvers.problem import (
    Contributions,
    Curvature,
    Quadratic,
    contributions_of_rows,
    gathered,
)
from scanlock.threads import parallel_map

_KEPT = "_near_pairs"
"""Under this name an objective keeps the pairs in reach of its last pose."""


@dataclass(frozen=True, kw_only=True, slots=True)
class ScoreShape:
    """The score of one pair as a function of its squared Mahalanobis distance s.

    ``-height exp(-sharpness s / 2)``, cut off by a window that is 1 up to `window_start` and
    falls to 0 at `window_end` with two continuous derivatives, so that skipping pairs beyond the
    end changes nothing that a solver can see.
    """

    sharpness: float = 1.0
    """1 in the paper; smaller values widen the basin (0.05 in Stoyanov's published code)."""

    height: float = 1.0
    """Score of a perfect pair. A factor of the whole value: it moves no minimum, but says how
    much the scans weigh against a prior, and how small a gradient is."""

    window_start: float = 16.0
    """Squared distance, times the sharpness, where the window begins to fall; what is cut
    weighs under e^-8."""

    window_end: float = 25.0
    """Squared distance, times the sharpness, from which a pair counts nothing."""

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
        """Return the Gaussian nearest to the log likelihood of a cell with outliers.

        A point of a cell comes from its Gaussian or, with the probability `outlier_ratio`, from
        anywhere in the cell: ``-log(c1 exp(-s / 2) + c2)``. The shape agrees with that at s = 0,
        at s = 1 and far away; in Magnusson 2009, equation 6.8, the height is ``-d1`` and the
        sharpness ``d2``. The window stays where it is in terms of the score, e^-8 of the height.

        Parameters
        ----------
        width : float [m]
            Side of the cells.
        outlier_ratio : float
            Above 0 and below 1; 0.55 in the Point Cloud Library.
        """
        require_positive("width", width, unit="m")
        if not 0.0 < outlier_ratio < 1.0:
            raise InvalidInput(f"outlier_ratio must lie above 0 and below 1, got {outlier_ratio}")
        # c1 / c2, how much likelier a point at the mean is under the Gaussian than without it.
        odds = 10.0 * (1.0 - outlier_ratio) * width**3 / outlier_ratio
        height = math.log1p(odds)
        at_one = math.log1p(odds * math.exp(-0.5))
        return cls(sharpness=-2.0 * math.log(at_one / height), height=height)

    @property
    def parameters(self) -> tuple[float, float, float]:
        """Sharpness, and the squared distances where the window begins and ends."""
        return (
            self.sharpness,
            self.window_start / self.sharpness,
            self.window_end / self.sharpness,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class GaussiansToGaussians:
    """D2D: Gaussians of the source against Gaussians of the target, each with every other.

    The value is minus the sum over all pairs of ``w_i w_j rho``, with the counts to
    `weight_power`, scaled to unit length, as the weights of either side; it is symmetric under
    exchange of the scans, unless `candidates` are chosen for the source.
    """

    target: Gaussians
    source: Gaussians
    shape: ScoreShape = field(default_factory=ScoreShape)
    weight_power: float = 0.5
    curvature: Curvature = "exact"
    candidates: Association | None = None
    """Pairs that count; None for all."""

    @property
    def count(self) -> int:
        """The Gaussians of the source."""
        return len(self.source)

    def linearise(self, pose: Pose) -> Quadratic:
        """Return value, gradient and Hessian at `pose`."""
        if self.candidates is not None:
            lists = self.candidates.at(pose.apply(self.source.means))
            terms = self._terms(pose, slice(None), lists)
        else:
            near = self._near_at(pose)
            parts = parallel_map(
                lambda part: self._terms(pose, near.rows(part), near.lists(part)), near.parts
            )
            terms = parts[0] if len(parts) == 1 else np.sum([np.zeros(28), *parts], axis=0)
        return Quadratic.from_terms(self.shape.height * terms)

    @property
    def places(self) -> Points:
        """The means of the source."""
        return self.source.means

    def shares(self, pose: Pose, units: Labels) -> Contributions:
        """Return what the Gaussians of each unit add to gradient and Hessian."""
        order, runs = gathered(units)
        ordered = replace(self, source=self.source.taken(order))
        if self.candidates is not None:
            lists, starts, members = self.candidates.at(pose.apply(ordered.source.means))
        else:
            every = slice(0, len(order))
            lists, starts, members = NeighbourLists(ordered._reach, pose).listed(every)
        terms = [ordered._terms(pose, run, (lists[run], starts, members)) for run in runs]
        return Contributions.from_terms(self.shape.height * np.array(terms))

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
    def _reach(self) -> Reach:
        _, _, window_end = self.shape.parameters
        return Reach(self.target, self.source, window_end)

    def _near_at(self, pose: Pose) -> NeighbourLists:
        near: NeighbourLists | None = self.__dict__.get(_KEPT)
        if near is None or not near.hold_at(pose):
            near = NeighbourLists(self._reach, pose)
            # Not part of what the objective is: values are the same whatever is kept.
            self.__dict__[_KEPT] = near
        return near


@dataclass(frozen=True, kw_only=True, eq=False)
class PointsToGaussians:
    """P2D: every point of the source against every Gaussian of the target.

    The value is minus the mean over the points of the sum over the Gaussians of ``rho``, the
    cost Lambda of the paper divided by the number of points.
    """

    target: Gaussians
    points: Points
    shape: ScoreShape = field(default_factory=ScoreShape)
    curvature: Curvature = "exact"

    @property
    def count(self) -> int:
        """The points of the source."""
        return len(self.points)

    @property
    def places(self) -> Points:
        """The points of the source."""
        return self.points

    def linearise(self, pose: Pose) -> Quadratic:
        """Return value, gradient and Hessian at `pose`."""
        return Quadratic.from_terms(self._terms(pose, *self._blocks))

    def shares(self, pose: Pose, units: Labels) -> Contributions:
        """Return what the points of each unit add to gradient and Hessian at `pose`."""

        def terms(points: Points) -> Vector:
            return self._terms(pose, points, point_balls(points))

        return contributions_of_rows(units, [self.points], terms)

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
        return self.shape.height / len(self.points) * terms

    @cached_property
    def _blocks(self) -> tuple[Points, Matrix]:
        """The points with neighbours together, and balls around each few of them."""
        order = np.argsort(morton_codes(read_only(self.points)))
        points = read_only(self.points[order])
        return points, read_only(point_balls(points))

    @cached_property
    def _rows(self) -> Matrix:
        """Mean, packed precision and reach [m] of each Gaussian, a row (10) each."""
        _, _, window_end = self.shape.parameters
        rows = np.empty((len(self.target), 10))
        rows[:, :3] = self.target.means
        rows[:, 3:9] = self.target.packed_precisions
        rows[:, 9] = np.sqrt(window_end * self.target.max_variances)
        return read_only(rows)
