"""The cost of generalised ICP: pairs of points with covariances (Segal et al. 2009, eq. 2)."""

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
    """Who met whom at one pose, held while the pose changes. Build with `at`.

    The value is the mean over the pairs of half the squared Mahalanobis distance, ``d' B d / 2``
    with ``d`` from the target point to the source point and ``B = (C_t + R C_s R')^-1``. Half,
    because minus the logarithm of a Gaussian is, and a prior is weighed against it.

    ``B`` keeps the rotation of the pose where the pairs met, as in Segal et al. and the code
    after them. Turned along with the pose it would draw the scans askew: surfaces at an angle
    have the larger sum of covariances, and so the smaller distance.

    Attributes
    ----------
    target, source : SurfacePoints
    target_rows, source_rows : (m,)
        Pair k is of these rows.
    precisions : (m, 6) [1/m^2]
        ``B`` of each pair, packed.
    curvature : str
        Whether the Hessian is exact or its convex part.
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
        partners: Labels,
        curvature: Curvature = "exact",
    ) -> "DistributionPairs":
        """Return the pairs that meet at a pose.

        Parameters
        ----------
        pose : Pose
            Target from source.
        target, source : SurfacePoints
        partners : (n,)
            For each point of the source the row of the target's point it met; -1 for none.
        curvature : str
            Which Hessian to give.
        """
        source_rows = read_only(np.flatnonzero(partners >= 0).astype(np.int64, copy=False))
        target_rows = read_only(partners[source_rows])
        precisions = pair_precisions(
            target.covariances, source.covariances, target_rows, source_rows, pose.rotation
        )
        return cls(target, source, target_rows, source_rows, precisions, curvature)

    @property
    def count(self) -> int:
        """How many pairs there are."""
        return len(self.target_rows)

    def squared_distances(self, pose: Pose) -> Vector:
        """Return the (m,) squared Mahalanobis distances ``d' B d`` at `pose`."""
        moved = pose.apply(self.source.points[self.source_rows])
        gaps = moved - self.target.points[self.target_rows]
        return np.einsum("ma,mab,mb->m", gaps, unpacked(self.precisions), gaps)

    @property
    def places(self) -> Points:
        """The point of the source of each pair."""
        return self.source.points[self.source_rows]

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
            self.target.points,
            self.source.points,
            precisions,
            target_rows,
            source_rows,
            pose.rotation,
            pose.translation,
            float(self.curvature == "exact"),
        )
        return terms / self.count
