"""Cost of point correspondences: Madhavan and Messina 2003, eq. (2), point-to-plane, with noise."""

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
    """Cost of point correspondences, each with a precision matrix.

    The value is the mean over the correspondences of ``d' P d / 2``. The residual d leads from
    the point of the target to that of the source, in the target's frame; P is the precision of
    the correspondence. The factor of one half is that of minus the logarithm of a Gaussian, which
    a prior is weighed against. P stays fixed while the pose changes; weights are factors of P.

    Attributes
    ----------
    target, source : (n, 3), (k, 3) [m]
        Points of either side, each in its own frame.
    target_rows, source_rows : (m,)
        Rows of the points of each correspondence.
    precisions : (m, 6) [1/m^2]
        Precisions packed as xx, xy, xz, yy, yz, zz; see the functions in this module.
    curvature : str
        Exact Hessian, or its convex part.
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
        """Number of correspondences."""
        return len(self.target_rows)

    @property
    def positions(self) -> Points:
        """Point of the source of each correspondence."""
        return self.source[self.source_rows]

    def linearise(self, pose: Pose) -> Quadratic:
        """Return value, gradient and Hessian at `pose`."""
        terms = self._terms(pose, self.precisions, self.target_rows, self.source_rows)
        return Quadratic.from_terms(terms)

    @property
    def is_continuous(self) -> bool:
        """True: the correspondences are fixed."""
        return True

    def contributions(self, pose: Pose, blocks: Labels) -> Contributions:
        """Return the gradient and Hessian of each block of correspondences at `pose`."""
        arrays = self.precisions, self.target_rows, self.source_rows
        return contributions_of_rows(blocks, arrays, partial(self._terms, pose))

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
        return terms / max(1, self.count)


def point_precisions(weights: Vector) -> Matrix:
    """Return the (m, 6) point-to-point precisions, ``d' P d = weight |d|^2``.

    Parameters
    ----------
    weights : (m,) [1/m^2]

    Returns
    -------
    (m, 6) [1/m^2]
        Packed upper triangles xx, xy, xz, yy, yz, zz.
    """
    return weights[:, None] * np.eye(3)[_ROWS, _COLUMNS]


def plane_precisions(normals: Points, weights: Vector) -> Matrix:
    """Return the (m, 6) point-to-plane precisions, ``d' P d = weight (n.d)^2``.

    Parameters
    ----------
    normals : (m, 3)
        Unit normals of either sign, in the target's frame.
    weights : (m,) [1/m^2]

    Returns
    -------
    (m, 6) [1/m^2]
        Packed upper triangles xx, xy, xz, yy, yz, zz.
    """
    return np.ascontiguousarray(weights[:, None] * normals[:, _ROWS] * normals[:, _COLUMNS])


def noise_precisions(target: Matrix, source: Matrix, pose: Pose) -> Matrix:
    """Return the (m, 6) precisions ``(C_t + R C_s R')^-1`` [1/m^2] of noisy correspondences.

    Parameters
    ----------
    target, source : (m, 6) [m^2]
        Packed covariances of either side, each in its own frame.
    pose : Pose
        Pose with the rotation R from the source's frame to the target's.
    """
    rows = read_only(np.arange(len(target)))
    return pair_precisions(read_only(target), read_only(source), rows, rows, pose.rotation)


def variances_along(normals: Points, covariances: Matrix) -> Vector:
    """Return the (m,) variances ``n' C n`` [m^2] of packed covariances along unit normals.

    Parameters
    ----------
    normals : (m, 3)
        Unit normals, in the frame of the covariances.
    covariances : (m, 6) [m^2]
    """
    doubled = covariances * np.array([1.0, 2.0, 2.0, 1.0, 2.0, 1.0])
    return np.einsum("mp,mp->m", doubled, normals[:, _ROWS] * normals[:, _COLUMNS])
