"""Constraints on a pose from cluster Gaussians: poles and trunks constrain it without planes."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Matrix, Points, Vector, frozen, short_repr
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import hats
from scanlock.models.gaussians import Gaussians

MotionKind = Literal["translation", "rotation"]

STEP_SLICES: dict[MotionKind, slice] = {"translation": slice(0, 3), "rotation": slice(3, 6)}
"""Components of a step ``(rho, phi)`` by kind of motion."""

_POWER = 4
"""Exponent of ``1 - variance / largest variance``: it separates thin axes from axes along which a
cluster was cut somewhat shorter than its longest axis."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class ClusterConstraints:
    """Information on a pose from the thin axes of a scan's cluster Gaussians.

    Attributes
    ----------
    information : (6, 6)
        Information matrix of a step ``(rho, phi)`` about the origin of the scan's frame, scaled
        such that the best constrained translation has 1.
    max_information : (6, 6)
        Information matrix if every Gaussian constrained all directions, with a total weight of 1.
    """

    information: Matrix
    max_information: Matrix

    __repr__ = short_repr

    def __post_init__(self) -> None:
        frozen(self.information)
        frozen(self.max_information)

    @classmethod
    def unconstrained(cls) -> "ClusterConstraints":
        """Return the constraints of a scan without clusters."""
        return cls(information=np.zeros((6, 6)), max_information=np.eye(6))

    def ratios(self, kind: MotionKind, axes: Matrix, origin: Vector) -> Vector:
        """Return the (k,) ratios of the information to its maximum, in [0, 1].

        Parameters
        ----------
        kind : str
            "translation" or "rotation".
        axes : (3, k)
            Unit vectors along or about which the source moves.
        origin : (3,) [m]
            Centre of the rotations. The translation is marginalised, so it may compensate them.
        """
        information, max_information = (
            _information_of_motion(matrix, origin, kind)
            for matrix in (self.information, self.max_information)
        )
        largest = np.maximum(quadratic_forms(max_information, axes), 1e-9)
        # The scale is that of the best constrained translation, so a rotation may exceed 1.
        return np.clip(quadratic_forms(information, axes) / largest, 0.0, 1.0)


def cluster_constraints(gaussians: Gaussians) -> ClusterConstraints:
    """Compute the constraints on a pose from the thin axes of cluster Gaussians.

    A Gaussian constrains translations along its thin axes. It does not constrain them along its
    longest axis: there a cluster was cut, or left the field of view, and its end moves with the
    sensor. The information along a principal axis is ``(1 - variance / largest variance)^4``,
    weighted by the number of points. If all Gaussians are round, each is a whole object and
    constrains all directions equally.
    """
    weights = gaussians.weights() ** 2
    identities = np.broadcast_to(np.eye(3), (len(gaussians), 3, 3))
    max_information = _total_information(gaussians.means, identities, weights)
    # Powers of a matrix share its axes, so no eigendecomposition is needed.
    relative = identities - gaussians.covariances / gaussians.max_variances[:, None, None]
    information = _total_information(
        gaussians.means, np.linalg.matrix_power(relative, _POWER), weights
    )
    largest = float(np.linalg.eigvalsh(information[:3, :3])[2])
    return ClusterConstraints(
        information=information / largest if largest > 0.0 else max_information,
        max_information=max_information,
    )


def quadratic_forms(matrix: Matrix, axes: Matrix) -> Vector:
    """Return the (k,) values ``a' matrix a`` of a (3, 3) matrix for the columns of (3, k) axes."""
    return (axes * (matrix @ axes)).sum(axis=0)


def _total_information(points: Points, information: NDArray[np.float64], weights: Vector) -> Matrix:
    """Return the (6, 6) information on a step, given (k, 3, 3) information at (k, 3) points."""
    # Derivative of each point with respect to a step.
    jacobians = np.concatenate(
        [np.broadcast_to(np.eye(3), information.shape), -hats(points)], axis=2
    )
    weighted = (weights[:, None, None] * information) @ jacobians
    return jacobians.reshape(-1, 6).T @ weighted.reshape(-1, 6)


def _information_of_motion(information: Matrix, origin: Vector, kind: MotionKind) -> Matrix:
    """Return the (3, 3) information on a kind of motion, for rotations about another origin."""
    if kind == "translation":
        return information[:3, :3]
    # The adjoint of a translation takes steps about `origin` to steps about the frame's origin.
    shift = Pose(np.eye(3), origin).adjoint()
    shifted = shift.T @ information @ shift
    coupling = shifted[3:, :3]
    return shifted[3:, 3:] - coupling @ np.linalg.pinv(shifted[:3, :3], hermitian=True) @ coupling.T
