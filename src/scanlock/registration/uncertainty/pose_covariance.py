"""How sure a pose is: a 6x6 covariance that says of what, in which order and in which frame."""

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from scanlock.arrays import Matrix, Points, Vector, frozen
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import hat

CovarianceMethod = Literal["sandwich", "hessian", "sampled"]
"""How a covariance is found, see `scanlock.registration.uncertainty.estimators`."""


@dataclass(frozen=True, slots=True, eq=False)
class PoseCovariance:
    """Covariance of the error of a pose, in the order and the frame of `PosePrior`.

    Attributes
    ----------
    matrix : (6, 6) [m^2, m rad, rad^2]
        Translation first: of where `place` lands in the target's frame, along the target's axes;
        then of the rotation vector that carries the pose's rotation into the true one, about the
        target's axes. Symmetric and positive definite along the free directions. What ``dof``
        locked is not a matter of the scans: its rows and columns are zero.
    pose : Pose
        The pose it belongs to, target from source, between the caller's frames.
    place : (3,) [m]
        The point of the source, in the caller's coordinates, that the first three rows speak
        about: zero, the sensor, for a scan in its sensor's frame; the middle of the source for
        coordinates far from zero, as in a prior.
    way : str
        How it was found: "sandwich", "hessian" or "sampled".
    units : float
        Effective number of independent pieces of evidence behind it; NaN where none are told
        apart.
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
                f"a pose covariance must be a finite (6, 6) matrix, got shape {matrix.shape}"
            )
        place = np.array(self.reference_point, np.float64)
        if place.shape != (3,) or not np.isfinite(place).all():
            raise InvalidInput(f"place must be three finite coordinates, got {place.tolist()}")
        matrix = 0.5 * (matrix + matrix.T)
        for name, array in (("matrix", matrix), ("reference_point", place)):
            frozen(array)
            object.__setattr__(self, name, array)

    @property
    def deviations(self) -> Vector:
        """The (6,) standard deviations along and about the target's axes [m, rad]."""
        return np.sqrt(np.diag(self.matrix))

    def at(self, point: Points) -> Matrix:
        """Return the (3, 3) covariance [m^2] of where a point of the source lands.

        Along the target's axes. The point (3,) [m] is given in the caller's coordinates of the
        source.
        """
        point = np.asarray(point, np.float64)
        if point.shape != (3,) or not np.isfinite(point).all():
            raise InvalidInput(f"point must be three finite coordinates, got {point.tolist()}")
        jacobian = self._moved_to(point)[:3]
        return jacobian @ self.matrix @ jacobian.T

    def in_source_frame(self) -> Matrix:
        """Return the (6, 6) covariance along and about the source's axes, translation first.

        Of the small motion before the pose: ``true = pose @ [exp(phi), rho]`` with ``rho`` and
        ``phi`` in the source's frame, at its zero. For a sensor that looks along x the
        components are forward, left, up, roll, pitch, yaw [m, rad].
        """
        turned = np.zeros((6, 6))
        turned[:3, :3] = turned[3:, 3:] = self.pose.rotation.T
        jacobian = turned @ self._moved_to(np.zeros(3))
        return jacobian @ self.matrix @ jacobian.T

    def in_source_frame_rotation_first(self) -> Matrix:
        """Return `in_source_frame` with the rotation first, as GTSAM wants it of a ``Pose3``."""
        return np.roll(self.in_source_frame(), 3, axis=(0, 1))

    def as_dict(self) -> dict[str, Any]:
        """Return the covariance as plain numbers and text."""
        return {
            "order": "translation of place, rotation; target's axes; m, rad",
            "matrix": self.matrix.tolist(),
            "reference_point": self.reference_point.tolist(),
            "method": self.method,
            "blocks": None if math.isnan(self.blocks) else self.blocks,
        }

    def _moved_to(self, point: Vector) -> Matrix:
        """Return the (6, 6) derivative of the error at another point in that at `place`."""
        jacobian = np.eye(6)
        jacobian[:3, 3:] = -hat(self.pose.rotation @ (point - self.reference_point))
        return jacobian

    def as_text(self) -> str:
        """Return the standard deviations along and about the source's axes, as people read them."""
        ahead, left, up, *turns = np.sqrt(np.diag(self.in_source_frame()))
        roll, pitch, yaw = np.degrees(turns)
        return (
            f"forward {1e3 * ahead:.2g}, left {1e3 * left:.2g}, up {1e3 * up:.2g} mm; "
            f"roll {roll:.2g}, pitch {pitch:.2g}, yaw {yaw:.2g} deg"
        )

    def __repr__(self) -> str:
        return f"PoseCovariance({self.method}: {self.as_text()})"

    def __reduce__(self) -> tuple[Any, ...]:
        return PoseCovariance, (
            np.array(self.matrix), self.pose, np.array(self.reference_point),
            self.method, self.blocks,
        )  # fmt: skip
