"""Covariance of an estimated pose, with its order, frame and reference point."""

import math
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import numpy as np

from scanlock.arrays import Matrix, Points, Vector, frozen
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose

CovarianceMethod = Literal["sandwich", "hessian", "sampled"]
"""Method of a covariance; see `scanlock.registration.uncertainty.covariance_estimator`."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class PoseCovariance:
    """Covariance of the error of an estimated pose, in the order and frame of `PosePrior`.

    Attributes
    ----------
    matrix : (6, 6) [m^2, m rad, rad^2]
        Covariance of the translation error of `reference_point`, then of the rotation vector from
        the estimated to the true rotation; both along the target's axes. Symmetric, and positive
        definite along the free directions. Rows and columns of directions locked by ``dof`` are
        zero.
    pose : Pose
        Estimated pose, target from source, between the caller's frames.
    reference_point : (3,) [m]
        Point of the source, in the caller's coordinates, to which the translation error refers.
        It is zero, the sensor, for a scan in its sensor's frame, and the origin of the source's
        local frame, near its centroid, for coordinates far from zero.
    method : str
        Method of the estimate: "sandwich", "hessian" or "sampled".
    blocks : float
        Effective number of independent blocks of the scene; NaN for the method "hessian".

    Raises
    ------
    InvalidInput
        A matrix or a reference point of the wrong shape, or with NaN or Inf.
    """

    matrix: Matrix
    pose: Pose
    reference_point: Vector
    method: CovarianceMethod
    blocks: float = math.nan

    def __post_init__(self) -> None:
        matrix = np.array(self.matrix, np.float64)
        if matrix.shape != (6, 6) or not np.isfinite(matrix).all():
            raise InvalidInput(
                f"matrix must be a finite (6, 6) covariance, got shape {matrix.shape}"
            )
        reference_point = _checked_point("reference_point", self.reference_point)
        matrix = 0.5 * (matrix + matrix.T)
        for name, array in (("matrix", matrix), ("reference_point", reference_point)):
            frozen(array)
            object.__setattr__(self, name, array)

    @property
    def deviations(self) -> Vector:
        """The (6,) standard deviations along and about the target's axes [m, rad]."""
        return np.sqrt(np.diag(self.matrix))

    def point_covariance(self, point: Points) -> Matrix:
        """Return the (3, 3) covariance of the position of a point of the source [m^2].

        Parameters
        ----------
        point : (3,) [m]
            Point in the caller's coordinates of the source. The covariance is along the target's
            axes.
        """
        jacobian = self._jacobian_at(_checked_point("point", point))[:3]
        return jacobian @ self.matrix @ jacobian.T

    def in_source_frame(self) -> Matrix:
        """Return the (6, 6) covariance along and about the source's axes, translation first.

        It is the covariance of a small motion before the pose, ``true = pose @ [exp(phi), rho]``,
        with ``rho`` and ``phi`` in the source's frame. For a sensor that looks along x the
        components are forward, left, up, roll, pitch, yaw [m, rad].
        """
        rotation = Pose(self.pose.rotation.T, np.zeros(3)).adjoint()
        jacobian = rotation @ self._jacobian_at(np.zeros(3))
        return jacobian @ self.matrix @ jacobian.T

    def in_source_frame_rotation_first(self) -> Matrix:
        """Return `in_source_frame` with the rotation first, the order of a GTSAM ``Pose3``."""
        return np.roll(self.in_source_frame(), 3, axis=(0, 1))

    def as_dict(self) -> dict[str, Any]:
        """Return the covariance as plain numbers and text, ready for JSON."""
        return {
            "order": "translation of the reference point, rotation; target's axes; m, rad",
            "matrix": self.matrix.tolist(),
            "reference_point": self.reference_point.tolist(),
            "method": self.method,
            "blocks": None if math.isnan(self.blocks) else self.blocks,
        }

    def _jacobian_at(self, point: Vector) -> Matrix:
        """Return the (6, 6) derivative of the error at a point by that at the reference point."""
        offset = self.pose.rotation @ (point - self.reference_point)
        return Pose(np.eye(3), -offset).adjoint()

    def __repr__(self) -> str:
        *lengths, roll, pitch, yaw = self.deviations
        millimetres = ", ".join(f"{1e3 * one:.2g}" for one in lengths)
        degrees = ", ".join(f"{math.degrees(one):.2g}" for one in (roll, pitch, yaw))
        return f"PoseCovariance({self.method}: {millimetres} mm and {degrees} deg at one sigma)"

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(
            PoseCovariance,
            matrix=np.array(self.matrix),
            pose=self.pose,
            reference_point=np.array(self.reference_point),
            method=self.method,
            blocks=self.blocks,
        ), ()


def _checked_point(name: str, point: Points) -> Vector:
    """Return a copy of a point.

    Raises
    ------
    InvalidInput
        The point is not three finite coordinates.
    """
    checked = np.array(point, np.float64)
    if checked.shape != (3,) or not np.isfinite(checked).all():
        raise InvalidInput(f"{name} must be three finite coordinates [m], got {checked.tolist()}")
    return checked
