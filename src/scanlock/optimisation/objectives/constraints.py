"""Constraints on a pose besides the scans: locked degrees of freedom and a Gaussian prior."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from scanlock.arrays import Matrix, Vector, frozen, short_repr
from scanlock.errors import InvalidInput, require_positive
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation, hat, inverse_left_jacobian
from scanlock.optimisation.solvers.problem import Objective, Quadratic

DegreesOfFreedom = Literal["xyz+rpy", "xyz+yaw", "xy+yaw"]
"""Degrees of freedom of a pose, along and about the axes of the target's frame."""

_FREE: dict[DegreesOfFreedom, tuple[float, ...]] = {
    "xyz+rpy": (1.0, 1.0, 1.0, 1.0, 1.0, 1.0),
    "xyz+yaw": (1.0, 1.0, 1.0, 0.0, 0.0, 1.0),
    "xy+yaw": (1.0, 1.0, 0.0, 0.0, 0.0, 1.0),
}

_MAX_ASYMMETRY = 1e-9
"""Maximum asymmetry of a covariance, relative to its largest entry: a limit for rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class PosePrior:
    """Gaussian prior of a pose, for example from odometry or a satellite receiver.

    Attributes
    ----------
    pose : Pose
        Mean, target from source.
    covariance : (6, 6) [m^2, m rad, rad^2]
        Covariance of a `Pose.perturbed` step: of the position of the source's origin in the
        target's frame, then of the rotation vector from the mean's rotation to the true one,
        about the target's axes. Symmetric and positive definite. For coordinates far from zero
        the origin is the middle of the source, and the notes of the result give it.

    Raises
    ------
    InvalidInput
        A covariance of another shape, an asymmetric one, or one that is not positive definite;
        ``dof`` locks a direction.
    """

    pose: Pose
    covariance: Matrix

    __repr__ = short_repr

    def __post_init__(self) -> None:
        covariance = np.array(self.covariance, np.float64)
        if covariance.shape != (6, 6) or not np.isfinite(covariance).all():
            raise InvalidInput(
                f"covariance must be a finite (6, 6) matrix, got shape {covariance.shape}"
            )
        asymmetry = float(np.abs(covariance - covariance.T).max())
        smallest = float(np.linalg.eigvalsh(covariance)[0])
        if asymmetry > _MAX_ASYMMETRY * float(np.abs(covariance).max()) or smallest <= 0.0:
            raise InvalidInput(
                "covariance must be symmetric and positive definite, got asymmetry "
                f"{asymmetry:.3g} and smallest eigenvalue {smallest:.3g}; dof locks a direction"
            )
        frozen(covariance)
        object.__setattr__(self, "covariance", covariance)

    @classmethod
    def from_deviations(cls, pose: Pose, translation: float, rotation: float) -> "PosePrior":
        """Return an isotropic prior from standard deviations [m] and [rad]."""
        require_positive("translation", translation, unit="m")
        require_positive("rotation", rotation, unit="rad")
        return cls(pose, np.diag([translation**2] * 3 + [rotation**2] * 3))

    @property
    def precision(self) -> Matrix:
        """The (6, 6) inverse of the covariance."""
        return np.linalg.inv(self.covariance).astype(np.float64, copy=False)

    def linearise(self, pose: Pose) -> Quadratic:
        """Return ``r' precision r / 2`` of the residual r at `pose`, with its convex Hessian.

        The residual is ``pose.difference(mean)``. Its second derivatives vanish at the mean and
        are left out of the Hessian, as in the Gauss-Newton method.
        """
        residual = pose.difference(self.pose)
        jacobian = np.eye(6)
        jacobian[:3, 3:] = -hat(pose.translation)
        jacobian[3:, 3:] = inverse_left_jacobian(residual[3:])
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
    """Constraints on a pose besides the scans."""

    dof: DegreesOfFreedom = "xyz+rpy"
    """Degrees of freedom; the other directions stay as in the initial pose."""

    prior: PosePrior | None = None
    """Prior of the pose between the local frames of the clouds."""

    def __post_init__(self) -> None:
        if self.dof not in _FREE:
            raise InvalidInput(f"dof must be one of {', '.join(_FREE)}, got {self.dof!r}")

    @property
    def is_free(self) -> bool:
        """Whether there is neither a locked direction nor a prior."""
        return self.dof == "xyz+rpy" and self.prior is None

    @property
    def free_directions(self) -> Vector:
        """The (6,) mask of a step ``(rho, phi)``: 1 for free components, 0 for locked ones."""
        return np.array(_FREE[self.dof])

    def project(self, pose: Pose, start: Pose) -> Pose:
        """Return the pose nearest to `pose` that leaves locked directions as in `start`."""
        if self.dof == "xyz+rpy":
            return pose
        turn = pose.rotation @ start.rotation.T
        yaw = np.arctan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1])
        translation = pose.translation.copy()
        if self.dof == "xy+yaw":
            translation[2] = start.translation[2]
        return Pose(exp_rotation(np.array([0.0, 0.0, yaw])) @ start.rotation, translation)

    def applied_to(self, objective: Objective) -> Objective:
        """Return the constrained objective; any solver can minimise it."""
        return objective if self.is_free else ConstrainedObjective(objective, self)


UNCONSTRAINED = Constraints()
"""No constraint."""


@dataclass(frozen=True, slots=True, eq=False)
class ConstrainedObjective:
    """An objective plus a prior, flat along the locked directions.

    Attributes
    ----------
    objective : Objective
        Objective of the scans.
    constraints : Constraints
        Locked directions and the prior.
    """

    objective: Objective
    constraints: Constraints

    @property
    def count(self) -> int:
        """Number of observations of the objective; a prior is not one of them."""
        return self.objective.count

    def linearise(self, pose: Pose) -> Quadratic:
        """Return value, gradient and Hessian at `pose`; empty without any observation."""
        if self.count == 0:
            return Quadratic.empty()
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
