"""The motion that brings pairs together: steps 2 and 3 of Madhavan and Messina 2003."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from scanlock.arrays import Vector
from scanlock.errors import InvalidInput, require_positive
from scanlock.geometry.pose import Pose
from scanlock.geometry.rigid_fit import PairMoments
from scanlock.models.sensor_noise import traces
from scanlock.optimisation.objectives.constraints import Constraints
from scanlock.optimisation.objectives.point_pairs import (
    PointPairs,
    noise_precisions,
    plane_precisions,
    point_precisions,
    variances_along,
)
from scanlock.optimisation.solvers.gauss_newton import gauss_newton_step
from scanlock.optimisation.solvers.problem import Quadratic
from scanlock.registration.methods.correspondences import Correspondences, PointScan, Residual

Step = Literal["svd", "quaternion", "gauss-newton"]
"""How the motion that fits the pairs best is found.

``"svd"`` and ``"quaternion"`` are closed forms of one answer, the best fit of points to points;
``"gauss-newton"`` linearises, and can do what they cannot: planes, full covariances and priors.
"""


_PACKED_IDENTITY = np.array([1.0, 0.0, 0.0, 1.0, 0.0, 1.0])


@dataclass(frozen=True, kw_only=True, slots=True)
class TransformEstimation:
    """Settings that turn pairs into a motion."""

    algorithm: Step = "svd"
    """How the motion is found."""

    residual: Residual = "point-to-point"
    """What is made small: the distance of a pair, or that to the target's surface."""

    sampling_deviation: float = 0.1
    """Standard deviation of a pair by sampling [m]: hardly a point of a surface is met again. It
    scales the objective, and so what a prior weighs against. A noise model comes on top of it for
    points, and in its place for planes, which do not care where a point lies on them."""

    rotation_scale: float = 20.0
    """Distance at which a rotation counts as a translation [m]; about the range of a scan."""

    def __post_init__(self) -> None:
        if self.algorithm not in ("svd", "quaternion", "gauss-newton"):
            raise InvalidInput(
                f"step must be 'svd', 'quaternion' or 'gauss-newton', got {self.algorithm!r}"
            )
        if self.residual not in ("point-to-point", "point-to-plane"):
            raise InvalidInput(
                f"residual must be 'point-to-point' or 'point-to-plane', got {self.residual!r}"
            )
        if self.residual == "point-to-plane" and self.algorithm != "gauss-newton":
            raise InvalidInput(
                "step must be 'gauss-newton' for point-to-plane, which has no closed form, got "
                f"{self.algorithm!r}"
            )
        require_positive("sampling_deviation", self.sampling_deviation, unit="m")
        require_positive("lever", self.rotation_scale, unit="m")

    def objective(
        self, target: PointScan, source: PointScan, pairs: Correspondences, pose: Pose
    ) -> PointPairs:
        """Return what the pairs of a pose cost, as it is written in eq. (2) of the paper.

        Noisy scans (those with covariances) weigh a pair by the inverse of its covariance at
        `pose`: whole for the step of Gauss and Newton, a third of its trace for closed forms.
        """
        rows = pairs.target_rows, pairs.source_rows
        weights = pairs.weights / self._variances(target, source, pairs, pose)
        if self.residual == "point-to-plane":
            precisions = plane_precisions(target.normals[rows[0]], weights)
        elif self.algorithm == "gauss-newton" and len(target.covariances):
            sampled = target.covariances[rows[0]] + self.sampling_deviation**2 * _PACKED_IDENTITY
            found = noise_precisions(sampled, source.covariances[rows[1]], pose)
            precisions = pairs.weights[:, None] * found
        else:
            precisions = point_precisions(weights)
        return PointPairs(
            target=target.points,
            source=source.points,
            target_rows=rows[0],
            source_rows=rows[1],
            precisions=precisions,
        )

    def next_pose(
        self, objective: PointPairs, quadratic: Quadratic, pose: Pose, constraints: Constraints
    ) -> tuple[Pose, str]:
        """Return the pose at which the pairs fit best, and a note where no closed form could.

        Parameters
        ----------
        objective : PointPairs
        quadratic : Quadratic
            Of the objective under the restraint, at `pose`.
        pose : Pose
            Where the pairs were made.
        restraint : Restraint
        """
        note = ""
        if self.algorithm != "gauss-newton":
            if constraints.prior is None:
                increment = self._closed_form(objective, pose, constraints)
                if increment is not None:
                    moved = increment @ pose
                    return moved, ""
                note = "pairs on a line hold no rotation: a step of Gauss and Newton instead"
            else:
                note = "no closed form heeds a prior: steps of Gauss and Newton instead"
        return pose.retract(gauss_newton_step(quadratic, self.rotation_scale)), note

    def _variances(
        self, target: PointScan, source: PointScan, pairs: Correspondences, pose: Pose
    ) -> Vector:
        """Return the (m,) variance of each residual [m^2], along one axis."""
        if not len(target.covariances):
            return np.full(len(pairs), self.sampling_deviation**2)
        of_target = target.covariances[pairs.target_rows]
        of_source = source.covariances[pairs.source_rows]
        if self.residual == "point-to-plane":
            normals = target.normals[pairs.target_rows]
            return variances_along(normals, of_target) + variances_along(
                normals @ pose.rotation, of_source
            )
        return (traces(of_target) + traces(of_source)) / 3.0 + self.sampling_deviation**2

    def _closed_form(
        self, objective: PointPairs, pose: Pose, constraints: Constraints
    ) -> Pose | None:
        """Return the motion after `pose` that fits best; None where the pairs hold none."""
        moments = PairMoments.of(
            objective.target[objective.target_rows],
            pose.apply(objective.source[objective.source_rows]),
            objective.precisions[:, 0],
        )
        if constraints.dof != "xyz+rpy":
            translation = "xyz" if constraints.dof == "xyz+yaw" else "xy"
            return moments.about_z(translation) if moments.constrains_yaw else None
        if not moments.constrains_rotation:
            return None
        return (
            moments.by_quaternion()
            if self.algorithm == "quaternion"
            else moments.by_singular_values()
        )
