"""The cost of pairs of points: eq. (2) of Madhavan and Messina 2003, to planes, or under noise."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector, frozen, read_only
from scanlock.geometry.pose import Pose
from scanlock.kernels.gaussians.pairs import pair_precisions, pair_terms
from scanlock.optimisation.solvers.problem import (
    Contributions,
    Curvature,
    Quadratic,
    contributions_of_rows,
)

_ROWS = [0, 0, 0, 1, 1, 2]
_COLUMNS = [0, 1, 2, 1, 2, 2]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class PointPairs:
    """Pairs of points, each with what its distance costs along every axis.

    The value is the mean over the pairs of ``d' P d / 2`` with ``d`` from the target's point to
    that of the source, in the target's frame, and P the precision of the pair. Half, because
    minus the logarithm of a Gaussian is, and a prior is weighed against it. P stays as it was
    where the pairs were made; what makes a pair count less is a factor in its P.

    Attributes
    ----------
    target, source : (n, 3), (k, 3) [m]
        Points of either side, each in its own frame.
    target_rows, source_rows : (m,)
        Pair i is of these rows.
    precisions : (m, 6) [1/m^2]
        Packed as xx, xy, xz, yy, yz, zz; see the functions beside.
    curvature : str
        Whether the Hessian is exact or its convex part.
    """

    target: Points
    source: Points
    target_rows: Labels
    source_rows: Labels
    precisions: Matrix
    curvature: Curvature = "convex"

    def __post_init__(self) -> None:
        for array in (
            self.target, self.source, self.target_rows, self.source_rows, self.precisions,
        ):  # fmt: skip
            frozen(array)

    @property
    def count(self) -> int:
        """How many pairs there are."""
        return len(self.target_rows)

    @property
    def places(self) -> Points:
        """The point of the source of each pair."""
        return self.source[self.source_rows]

    def linearise(self, pose: Pose) -> Quadratic:
        """Return value, gradient and Hessian at `pose`; there must be a pair."""
        terms = self._terms(pose, self.precisions, self.target_rows, self.source_rows)
        return Quadratic.from_terms(terms)

    def shares(self, pose: Pose, units: Labels) -> Contributions:
        """Return what the pairs of each unit add to gradient and Hessian at `pose`."""
        pairs = self.precisions, self.target_rows, self.source_rows
        return contributions_of_rows(units, pairs, partial(self._terms, pose))

    def _terms(
        self, pose: Pose, precisions: Matrix, target_rows: Labels, source_rows: Labels
    ) -> Vector:
        terms = pair_terms(
            self.target,
            self.source,
            precisions,
            target_rows,
            source_rows,
            pose.rotation,
            pose.translation,
            float(self.curvature == "exact"),
        )
        return terms / self.count


def point_precisions(weights: Vector) -> Matrix:
    """Return (m, 6) the precisions under which ``d' P d = weight |d|^2``: point to point.

    Parameters
    ----------
    weights : (m,) [1/m^2]
    """
    return weights[:, None] * np.eye(3)[_ROWS, _COLUMNS]


def plane_precisions(normals: Points, weights: Vector) -> Matrix:
    """Return (m, 6) the precisions under which ``d' P d = weight (n.d)^2``: point to plane.

    Parameters
    ----------
    normals : (m, 3)
        Unit normals of either sign, in the target's frame.
    weights : (m,) [1/m^2]
    """
    return np.ascontiguousarray(weights[:, None] * normals[:, _ROWS] * normals[:, _COLUMNS])


def noise_precisions(target: Matrix, source: Matrix, pose: Pose) -> Matrix:
    """Return (m, 6) ``(C_t + R C_s R')^-1`` [1/m^2] of pairs with these covariances.

    Parameters
    ----------
    target, source : (m, 6) [m^2]
        Packed covariances of either side, each in its own frame.
    pose : Pose
        Whose rotation R turns the source's.
    """
    rows = read_only(np.arange(len(target)))
    return pair_precisions(read_only(target), read_only(source), rows, rows, pose.rotation)


def variances_along(normals: Points, covariances: Matrix) -> Vector:
    """Return (m,) ``n' C n`` [m^2] of packed covariances along unit normals in the same frame."""
    doubled = covariances * np.array([1.0, 2.0, 2.0, 1.0, 2.0, 1.0])
    return np.einsum("mp,mp->m", doubled, normals[:, _ROWS] * normals[:, _COLUMNS])
