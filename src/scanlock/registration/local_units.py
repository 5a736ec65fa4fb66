"""Conversion between metres and the units of length in which a pair of scans is registered.

A sparse pair is registered in units of its length scale, see `scanlock.clouds.length_scale`. All
that goes in is divided by it, and all that comes out is multiplied, so a caller sees metres.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from scanlock.arrays import Matrix
from scanlock.geometry.pose import Pose
from scanlock.optimisation.objectives.constraints import PosePrior
from scanlock.optimisation.solvers.notes import LengthNote
from scanlock.optimisation.solvers.problem import Quadratic
from scanlock.optimisation.solvers.solution import Iteration, Solution
from scanlock.registration.verification.assessment import Assessment
from scanlock.registration.verification.observability import (
    DirectionObservability,
    Observability,
)


@dataclass(frozen=True, slots=True)
class LocalUnits:
    """Units of length of a pair, in its local frames."""

    scale: float = 1.0
    """Length of a unit [m]; with 1 nothing is converted."""

    def from_metres(self, pose: Pose) -> Pose:
        """Return a pose in metres with its translation in units."""
        return _scaled(pose, 1.0 / self.scale)

    def to_metres(self, pose: Pose) -> Pose:
        """Return a pose in units with its translation in metres."""
        return _scaled(pose, self.scale)

    def prior_from_metres(self, prior: PosePrior) -> PosePrior:
        """Return a prior in metres as one in units."""
        if self.scale == 1.0:
            return prior
        return PosePrior(
            self.from_metres(prior.pose), _congruent(prior.covariance, 1.0 / self.scale)
        )

    def covariance_to_metres(self, covariance: Matrix) -> Matrix:
        """Return the (6, 6) covariance of a step ``(rho, phi)`` in metres and radians."""
        return covariance if self.scale == 1.0 else _congruent(covariance, self.scale)

    def solution_to_metres(self, solution: Solution) -> Solution:
        """Return a solution in metres, without its objective."""
        if self.scale == 1.0:
            return solution
        return replace(
            solution,
            pose=self.to_metres(solution.pose),
            quadratic=self._quadratic(solution.quadratic),
            history=tuple(self._iteration(one) for one in solution.history),
            candidates=tuple(
                one.with_pose(self.to_metres(one.target_from_source)) for one in solution.candidates
            ),
            notes=tuple(
                one.scaled(self.scale) if isinstance(one, LengthNote) else one
                for one in solution.notes
            ),
            objective=None,
        )

    def assessment_to_metres(self, assessment: Assessment) -> Assessment:
        """Return an assessment in metres."""
        if self.scale == 1.0:
            return assessment
        metrics, centroid = assessment.metrics, assessment.overlap_centroid
        return replace(
            assessment,
            metrics=replace(
                metrics,
                inlier_rmse=self.scale * metrics.inlier_rmse,
                roughness=self.scale * metrics.roughness,
                refinement_shift=self.scale * metrics.refinement_shift,
            ),
            observability=self._observability(assessment.observability),
            overlap_centroid=None if centroid is None else self.scale * centroid,
        )

    def _quadratic(self, quadratic: Quadratic) -> Quadratic:
        gradient = quadratic.gradient / _factors(self.scale)
        return Quadratic(quadratic.value, gradient, _congruent(quadratic.hessian, 1.0 / self.scale))

    def _iteration(self, one: Iteration) -> Iteration:
        return replace(
            one,
            gradient_norm=one.gradient_norm / self.scale,
            step_norm=self.scale * one.step_norm,
            pose=self.to_metres(one.pose),
            mean_distance=self.scale * one.mean_distance,
        )

    def _observability(self, found: Observability | None) -> Observability | None:
        if found is None:
            return None
        return Observability(
            directions=self._directions(found.directions),
            information=_congruent(found.information, 1.0 / self.scale),
        )

    def _directions(
        self, directions: Sequence[DirectionObservability]
    ) -> tuple[DirectionObservability, ...]:
        return tuple(
            replace(one, deviation=self.scale * one.deviation) if one.kind == "translation" else one
            for one in directions
        )


def _scaled(pose: Pose, factor: float) -> Pose:
    return pose if factor == 1.0 else Pose(pose.rotation, factor * pose.translation)


def _factors(factor: float) -> Matrix:
    """Return the (6,) factors of a step ``(rho, phi)``: rotations have no unit of length."""
    return np.repeat([factor, 1.0], 3)


def _congruent(matrix: Matrix, factor: float) -> Matrix:
    """Return a (6, 6) matrix with the rows and columns of translations times a factor."""
    factors = _factors(factor)
    return matrix * np.outer(factors, factors)
