"""Cost of generalised ICP: correspondences with covariances (Segal et al. 2009, eq. 2)."""

from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Labels, Vector, read_only
from scanlock.geometry.pose import Pose
from scanlock.kernels.gaussians.pairs import pair_precisions
from scanlock.models.gaussians import unpacked
from scanlock.models.surface_points import SurfacePoints
from scanlock.optimisation.objectives.point_pairs import PointPairs
from scanlock.optimisation.solvers.problem import Curvature


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class DistributionPairs(PointPairs):
    """Cost of point correspondences with the covariances of both surfaces. Build with `at`.

    The residual is a Mahalanobis distance: the precision of a correspondence is
    ``B = (C_t + R C_s R')^-1``.

    Notes
    -----
    ``B`` keeps the rotation of the pose where the correspondences were found, as in Segal et al.
    and the code after them. If it followed the pose, it would bias the rotation: surfaces at an
    angle have the larger sum of covariances, and so the smaller distance.
    """

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
        return cls(
            target=target.points,
            source=source.points,
            target_rows=target_rows,
            source_rows=source_rows,
            precisions=precisions,
            curvature=curvature,
        )

    def squared_distances(self, pose: Pose) -> Vector:
        """Return the (m,) squared Mahalanobis distances ``d' B d`` at `pose`."""
        moved = pose.apply(self.source[self.source_rows])
        residuals = moved - self.target[self.target_rows]
        return np.einsum("ma,mab,mb->m", residuals, unpacked(self.precisions), residuals)
