"""What is known of the pose besides the scans: locked directions, and a Gaussian prior."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from scanlock.arrays import Matrix, Vector, frozen
from scanlock.errors import InvalidInput, require_positive
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation, hat, inverse_left_jacobian, log_rotation
from scanlock.optimisation.solvers.problem import Objective, Quadratic

DegreesOfFreedom = Literal["xyz+rpy", "xyz+yaw", "xy+yaw"]
"""What may change of the initial pose, along and about the axes of the target's frame."""

_FREE: dict[DegreesOfFreedom, tuple[float, ...]] = {
    "xyz+rpy": (1.0, 1.0, 1.0, 1.0, 1.0, 1.0),
    "xyz+yaw": (1.0, 1.0, 1.0, 0.0, 0.0, 1.0),
    "xy+yaw": (1.0, 1.0, 0.0, 0.0, 0.0, 1.0),
}

_SYMMETRY = 1e-9
"""Largest asymmetry of a covariance, relative to its largest entry, that rounding explains."""


@dataclass(frozen=True, slots=True, eq=False)
class PosePrior:
    """A Gaussian belief about the pose, from odometry or a satellite receiver.

    Attributes
    ----------
    pose : Pose
        The mean, target from source.
    covariance : (6, 6) [m^2, m rad, rad^2]
        Of where the origin of the source lies in the target's frame, then of the rotation vector
        that carries the mean's rotation into the true one, about the target's axes. Symmetric
        and positive definite. The origin is that of the caller's coordinates for a scan about
        its sensor; for coordinates far from zero it is the middle of the source, and the notes
        of the result say where.

    Raises
    ------
    InvalidInput
        A covariance of another shape, not symmetric, or with a direction of no variance; to lock
        a direction use ``dof``.
    """

    pose: Pose
    covariance: Matrix

    def __post_init__(self) -> None:
        covariance = np.array(self.covariance, np.float64)
        if covariance.shape != (6, 6) or not np.isfinite(covariance).all():
            raise InvalidInput(
                f"covariance must be a finite (6, 6) matrix, got shape {covariance.shape}"
            )
        gap = float(np.abs(covariance - covariance.T).max())
        least = float(np.linalg.eigvalsh(covariance)[0])
        if gap > _SYMMETRY * float(np.abs(covariance).max()) or least <= 0.0:
            raise InvalidInput(
                "covariance must be symmetric and positive definite, got asymmetry "
                f"{gap:.3g} and least eigenvalue {least:.3g}; dof locks a direction"
            )
        frozen(covariance)
        object.__setattr__(self, "covariance", covariance)

    @classmethod
    def from_deviations(cls, pose: Pose, translation: float, rotation: float) -> "PosePrior":
        """Return a prior as sure along every axis: deviations [m] and [rad]."""
        require_positive("translation", translation, unit="m")
        require_positive("rotation", rotation, unit="rad")
        return cls(pose, np.diag([translation**2] * 3 + [rotation**2] * 3))

    @property
    def precision(self) -> Matrix:
        """The (6, 6) inverse of the covariance."""
        return np.linalg.inv(self.covariance).astype(np.float64, copy=False)

    def linearise(self, pose: Pose) -> Quadratic:
        """Return ``r' precision r / 2`` of the residual r at `pose`, with its convex Hessian.

        The residual is the translation between the two places of the source's origin and the
        rotation vector from the mean's rotation to that of `pose`; its second derivatives are
        left out of the Hessian, as Gauss and Newton do. They vanish at the mean.
        """
        turn = log_rotation(pose.rotation @ self.pose.rotation.T)
        residual = np.concatenate([pose.translation - self.pose.translation, turn])
        jacobian = np.eye(6)
        jacobian[:3, 3:] = -hat(pose.translation)
        jacobian[3:, 3:] = inverse_left_jacobian(turn)
        precision = self.precision
        pulled = precision @ residual
        return Quadratic(
            0.5 * float(residual @ pulled), jacobian.T @ pulled, jacobian.T @ precision @ jacobian
        )

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, PosePrior):
            return NotImplemented
        return self.pose == other.pose and np.array_equal(self.covariance, other.covariance)

    def __hash__(self) -> int:
        return hash((self.pose, self.covariance.tobytes()))

    def __reduce__(self) -> tuple[Any, ...]:
        return PosePrior, (self.pose, np.array(self.covariance))


@dataclass(frozen=True, kw_only=True, slots=True)
class Constraints:
    """What holds a pose besides the scans."""

    dof: DegreesOfFreedom = "xyz+rpy"
    """Directions that may change; the others stay as in the initial pose."""

    prior: PosePrior | None = None
    """Between the local frames of the clouds."""

    def __post_init__(self) -> None:
        if self.dof not in _FREE:
            raise InvalidInput(f"dof must be one of {', '.join(_FREE)}, got {self.dof!r}")

    @property
    def is_free(self) -> bool:
        """Whether nothing is held at all."""
        return self.dof == "xyz+rpy" and self.prior is None

    @property
    def free_directions(self) -> Vector:
        """The (6,) ones for the components of a step ``(rho, phi)`` that may change, else 0."""
        return np.array(_FREE[self.dof])

    def held(self, pose: Pose, start: Pose) -> Pose:
        """Return the pose nearest to `pose` that leaves locked directions as in `start`."""
        if self.dof == "xyz+rpy":
            return pose
        turn = pose.rotation @ start.rotation.T
        yaw = np.arctan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1])
        translation = pose.translation.copy()
        if self.dof == "xy+yaw":
            translation[2] = start.translation[2]
        return Pose(exp_rotation(np.array([0.0, 0.0, yaw])) @ start.rotation, translation)

    def on(self, objective: Objective) -> Objective:
        """Return the objective under this restraint; any solver can minimise it."""
        return objective if self.is_free else ConstrainedObjective(objective, self)


UNCONSTRAINED = Constraints()
"""No restraint at all."""


@dataclass(frozen=True, slots=True, eq=False)
class ConstrainedObjective:
    """An objective plus the prior's share, flat along the locked directions.

    Attributes
    ----------
    objective : Objective
        What the scans say.
    restraint : Restraint
        What else holds the pose.
    """

    objective: Objective
    constraints: Constraints

    @property
    def count(self) -> int:
        """As of the objective alone."""
        return self.objective.count

    def linearise(self, pose: Pose) -> Quadratic:
        """Return value, gradient and Hessian at `pose`."""
        quadratic = self.objective.linearise(pose)
        value, gradient, hessian = quadratic.value, quadratic.gradient, quadratic.hessian
        if self.constraints.prior is not None:
            # The objective is a mean over its observations, and a prior is not one of them.
            prior = self.constraints.prior.linearise(pose)
            value += prior.value / self.count
            gradient = gradient + prior.gradient / self.count
            hessian = hessian + prior.hessian / self.count
        free = self.constraints.free_directions
        return Quadratic(value, free * gradient, hessian * np.outer(free, free))
