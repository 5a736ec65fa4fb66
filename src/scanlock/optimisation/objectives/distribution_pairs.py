"""Cost of generalised ICP: correspondences with covariances (Segal et al. 2009, eq. 2)."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector, frozen, read_only
from scanlock.geometry.pose import Pose
from scanlock.kernels.gaussians.pairs import pair_precisions, pair_terms
from scanlock.models.gaussians import unpacked
from scanlock.models.surface_points import SurfacePoints
from scanlock.optimisation.solvers.problem import (
    Contributions,
    Curvature,
    Quadratic,
    contributions_of_rows,
)


@dataclass(frozen=True, slots=True, eq=False)
class DistributionPairs:
    """Correspondences found at one pose, fixed while the pose changes. Build with `at`.

    The value is the mean over the correspondences of half the squared Mahalanobis distance,
    ``d' B d / 2`` with ``d`` from the target point to the source point and
    ``B = (C_t + R C_s R')^-1``. The factor of one half is that of minus the logarithm of a
    Gaussian, which a prior is weighed against.

    Attributes
    ----------
    target, source : SurfacePoints
    target_rows, source_rows : (m,)
        Rows of the points of each correspondence.
    precisions : (m, 6) [1/m^2]
        ``B`` of each correspondence, packed.
    curvature : str
        Exact Hessian, or its convex part.

    Notes
    -----
    ``B`` keeps the rotation of the pose where the correspondences were found, as in Segal et al.
    and the code after them. If it followed the pose, it would bias the rotation: surfaces at an
    angle have the larger sum of covariances, and so the smaller distance.
    """

    target: SurfacePoints
    source: SurfacePoints
    target_rows: Labels
    source_rows: Labels
    precisions: Matrix
    curvature: Curvature

    def __post_init__(self) -> None:
        for array in (self.target_rows, self.source_rows, self.precisions):
            frozen(array)

    @classmethod
    def at(
        cls,
        pose: Pose,
        target: SurfacePoints,
        source: SurfacePoints,
        correspondences: Labels,
        curvature: Curvature = "exact",
    ) -> "DistributionPairs":
        """Return the objective of the correspondences found at a pose.

        Parameters
        ----------
        pose : Pose
            Target from source.
        target, source : SurfacePoints
        correspondences : (n,)
            Row of the target's point for each point of the source; -1 for none.
        curvature : str
            Exact Hessian, or its convex part.
        """
        source_rows = read_only(np.flatnonzero(correspondences >= 0).astype(np.int64, copy=False))
        target_rows = read_only(correspondences[source_rows])
        precisions = pair_precisions(
            target.covariances, source.covariances, target_rows, source_rows, pose.rotation
        )
        return cls(target, source, target_rows, source_rows, precisions, curvature)

    @property
    def count(self) -> int:
        """Number of correspondences."""
        return len(self.target_rows)

    def squared_distances(self, pose: Pose) -> Vector:
        """Return the (m,) squared Mahalanobis distances ``d' B d`` at `pose`."""
        moved = pose.apply(self.source.points[self.source_rows])
        residuals = moved - self.target.points[self.target_rows]
        return np.einsum("ma,mab,mb->m", residuals, unpacked(self.precisions), residuals)

    @property
    def positions(self) -> Points:
        """Point of the source of each correspondence."""
        return self.source.points[self.source_rows]

    def linearise(self, pose: Pose) -> Quadratic:
        """Return value, gradient and Hessian at `pose`."""
        terms = self._terms(pose, self.precisions, self.target_rows, self.source_rows)
        return Quadratic.from_terms(terms)

    def contributions(self, pose: Pose, blocks: Labels) -> Contributions:
        """Return the gradient and Hessian of each block of correspondences at `pose`."""
        arrays = self.precisions, self.target_rows, self.source_rows
        return contributions_of_rows(blocks, arrays, partial(self._terms, pose))

    def _terms(
        self, pose: Pose, precisions: Matrix, target_rows: Labels, source_rows: Labels
    ) -> Vector:
        terms = pair_terms(
            self.target.points,
            self.source.points,
            precisions,
            target_rows,
            source_rows,
            pose.rotation,
            pose.translation,
            float(self.curvature == "exact"),
        )
        return terms / max(1, self.count)
