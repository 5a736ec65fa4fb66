"""Transform estimation from correspondences: steps 2 and 3 of Madhavan and Messina 2003."""

from dataclasses import dataclass
from typing import Literal, get_args

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
from scanlock.registration.methods.icp.correspondences import Correspondences, PointScan, Residual

Algorithm = Literal["svd", "quaternion", "gauss-newton"]
"""Algorithm that minimises the residuals of fixed correspondences.

``"svd"`` and ``"quaternion"`` are closed forms for point-to-point residuals with the same result.
``"gauss-newton"`` takes one step. It also handles planes, full covariances and priors.
"""

_PACKED_IDENTITY = np.array([1.0, 0.0, 0.0, 1.0, 0.0, 1.0])


@dataclass(frozen=True, kw_only=True, slots=True)
class TransformEstimation:
    """Settings of the transform estimation from correspondences."""

    algorithm: Algorithm = "svd"
    """Algorithm that minimises the residuals."""

    residual: Residual = "point-to-point"
    """Residual of a correspondence: its distance, or the distance to the plane of the target."""

    sampling_deviation: float = 0.1
    """Standard deviation of a correspondence due to sampling [m]: two scans hardly ever measure the
    same point. It scales the objective and so the weight of a prior. A noise model is added to it
    for points, and replaces it for planes, whose residuals do not depend on the sampling."""

    rotation_scale: float = 20.0
    """Distance at which a rotation counts as a translation [m]; about the range of a scan."""

    def __post_init__(self) -> None:
        for name, value, choices in (
            ("algorithm", self.algorithm, get_args(Algorithm)),
            ("residual", self.residual, get_args(Residual)),
        ):
            if value not in choices:
                raise InvalidInput(f"{name} must be one of {', '.join(choices)}, got {value!r}")
        if self.residual == "point-to-plane" and self.algorithm != "gauss-newton":
            raise InvalidInput(
                "algorithm must be 'gauss-newton' for point-to-plane, which has no closed form, "
                f"got {self.algorithm!r}"
            )
        require_positive("sampling_deviation", self.sampling_deviation, unit="m")
        require_positive("rotation_scale", self.rotation_scale, unit="m")

    def objective(
        self, target: PointScan, source: PointScan, pairs: Correspondences, pose: Pose
    ) -> PointPairs:
        """Return the objective of the correspondences at a pose, eq. (2) of the paper.

        With noise covariances each correspondence is weighted by its inverse covariance at `pose`:
        the full matrix for Gauss-Newton, a third of its trace for closed forms.
        """
        rows = pairs.target_rows, pairs.source_rows
        weights = pairs.weights / self._variances(target, source, pairs, pose)
        if self.residual == "point-to-plane":
            precisions = plane_precisions(target.normals[rows[0]], weights)
        elif self.algorithm == "gauss-newton" and len(target.covariances):
            sampled = target.covariances[rows[0]] + self.sampling_deviation**2 * _PACKED_IDENTITY
            unweighted = noise_precisions(sampled, source.covariances[rows[1]], pose)
            precisions = pairs.weights[:, None] * unweighted
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
        """Return the minimising pose of fixed correspondences, or the pose of the next step.

        Parameters
        ----------
        objective : PointPairs
        quadratic : Quadratic
            The constrained objective at `pose`.
        pose : Pose
            The pose of the correspondences.
        constraints : Constraints

        Returns
        -------
        pose : Pose
        note : str
            Why Gauss-Newton replaced the closed form; empty if it did not.
        """
        note = ""
        if self.algorithm != "gauss-newton":
            if constraints.prior is None:
                increment = self._closed_form(objective, pose, constraints)
                if increment is not None:
                    return increment @ pose, ""
                note = "correspondences on a line leave a rotation open: Gauss-Newton step instead"
            else:
                note = "closed forms cannot include a prior: Gauss-Newton steps instead"
        return pose.retract(gauss_newton_step(quadratic, self.rotation_scale)), note

    def _variances(
        self, target: PointScan, source: PointScan, pairs: Correspondences, pose: Pose
    ) -> Vector:
        """Return the (m,) variance of each residual along one axis [m^2]."""
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
        """Return the best motion after `pose`; None if the correspondences do not determine it."""
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
