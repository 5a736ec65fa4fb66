"""Rigid transforms between two frames, and the geometric conventions of scanlock.

======================= ==========================================================================
roles                   ``target`` is fixed, ``source`` is moved (the papers' reference and scene)
transforms              ``a_from_b``; chains cancel: ``a_from_c = a_from_b @ b_from_c``
angles, lengths         radians and metres; degrees only at the command line and in reports, where
                        the name ends in ``_deg``
step vector             ``(rho, phi)``: translation first, as in the papers; SciPy puts the rotation
                        first
retraction              ``y -> exp(phi) y + rho`` for a point ``y`` already in the target frame;
                        its Jacobian is ``[I, -hat(y)]``; `Pose.retract`
perturbation            ``[R, t] -> [exp(phi) R, t + rho]``, a rotation about the origin of the
                        source; used by priors, covariances and refinement; `Pose.perturbed`
======================= ==========================================================================
"""

import math
from dataclasses import dataclass
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scanlock.arrays import Matrix, Points, Vector, frozen
from scanlock.errors import InvalidInput
from scanlock.geometry.rotations import (
    exp_rotation,
    hat,
    log_rotation,
    nearest_rotation,
    rotation_angle,
)

_ROTATION_TOLERANCE = 1e-2
"""Largest difference of an entry from the nearest rotation that `Pose.from_matrix` corrects.

Matrices printed with few digits differ by 1e-6 to 1e-3, scaled or sheared ones by far more.
"""

_ROUNDING = 1e-6
"""Largest entry of ``R R' - I`` that the constructor accepts.

Long chains in float64 stay below 1e-12; a rotation stored in float32 differs by 1e-7.
"""


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """Rigid transform ``x -> rotation @ x + translation``.

    Attributes
    ----------
    rotation : (3, 3)
        Orthonormal matrix with determinant +1; read-only.
    translation : (3,) [m]
        Translation; read-only.

    Raises
    ------
    InvalidInput
        Wrong shape, NaN or Inf, or a rotation that is not orthonormal to rounding.
        `Pose.from_matrix` corrects matrices that were printed with few digits.
    """

    rotation: Matrix
    translation: Vector

    def __post_init__(self) -> None:
        self._keep(
            _real_array("rotation", self.rotation, [(3, 3)]),
            _real_array("translation", self.translation, [(3,)]),
        )
        if not self._is_rotation():
            raise InvalidInput(
                f"rotation must be orthonormal with determinant +1, got {self.rotation.tolist()}; "
                "Pose.from_matrix corrects small deviations"
            )

    def _is_rotation(self) -> bool:
        # No entry of a rotation exceeds 1, and huge numbers would overflow in the products.
        if np.abs(self.rotation).max() > 1.0 + _ROUNDING:
            return False
        residual = float(np.abs(self.rotation @ self.rotation.T - np.eye(3)).max())
        return residual <= _ROUNDING and np.linalg.det(self.rotation) > 0.0

    @classmethod
    def _of_poses(cls, rotation: Matrix, translation: Vector) -> "Pose":
        """Return a pose computed from valid poses, without checks."""
        pose = object.__new__(cls)
        pose._keep(rotation, translation)
        return pose

    def _keep(self, rotation: Matrix, translation: Vector) -> None:
        for name, array in (("rotation", rotation), ("translation", translation)):
            # Adding zero turns -0.0 into 0.0, so that equal poses have equal bytes to hash.
            array = np.ascontiguousarray(array) + 0.0
            frozen(array)
            object.__setattr__(self, name, array)

    @classmethod
    def identity(cls) -> "Pose":
        """Return the identity transform."""
        return cls(np.eye(3), np.zeros(3))

    @classmethod
    def from_matrix(cls, matrix: ArrayLike, name: str = "pose") -> "Pose":
        """Return the pose of a homogeneous matrix.

        A rotation that is slightly inaccurate (printed with few digits) is replaced by the
        nearest rotation.

        Parameters
        ----------
        matrix : (4, 4) or (3, 4)
            Homogeneous matrix, translation in metres.
        name : str
            Name of the matrix in error messages.

        Raises
        ------
        InvalidInput
            Wrong shape, NaN, a last row other than (0, 0, 0, 1), or a 3x3 part that is not a
            rotation (scaled, sheared or mirrored).
        """
        array = _real_array(name, matrix, [(4, 4), (3, 4)])
        if array.shape == (4, 4) and not np.allclose(array[3], (0, 0, 0, 1), atol=1e-6):
            remedy = "; transpose it" if np.allclose(array[:, 3], (0, 0, 0, 1), atol=1e-6) else ""
            raise InvalidInput(
                f"the last row of {name} must be 0 0 0 1, got {array[3].tolist()}{remedy}"
            )
        rotation = nearest_rotation(array[:3, :3])
        difference = float(np.abs(rotation - array[:3, :3]).max())
        if difference > _ROTATION_TOLERANCE:
            raise InvalidInput(
                f"the 3x3 part of {name} must be a rotation, got a matrix that differs from the "
                f"nearest rotation by {difference:.3g} (at most {_ROTATION_TOLERANCE:g} is "
                f"corrected): {_remedy(array)}"
            )
        return cls._of_poses(rotation, array[:3, 3])

    @classmethod
    def from_step(cls, step: Vector) -> "Pose":
        """Return the transform ``y -> exp(phi) y + rho`` of a step ``(rho, phi)`` [m, rad]."""
        step = _real_array("step", step, [(6,)])
        return cls._of_poses(exp_rotation(step[3:]), step[:3])

    @property
    def matrix(self) -> Matrix:
        """The (4, 4) homogeneous matrix; a new array at each access."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.rotation
        matrix[:3, 3] = self.translation
        return matrix

    def apply(self, points: Points) -> Points:
        """Return the transformed (..., 3) points [m]."""
        points = np.asarray(points)
        if points.ndim == 0 or points.shape[-1] != 3:
            raise InvalidInput(f"points must have shape (..., 3), got {points.shape}")
        return points @ self.rotation.T + self.translation

    @overload
    def __matmul__(self, other: "Pose") -> "Pose": ...
    @overload
    def __matmul__(self, other: NDArray[Any]) -> Points: ...
    def __matmul__(self, other: "Pose | NDArray[Any]") -> "Pose | Points":
        """Compose with a pose, or transform (..., 3) points."""
        if not isinstance(other, Pose):
            return self.apply(other)
        return Pose._of_poses(
            self.rotation.dot(other.rotation),
            self.rotation.dot(other.translation) + self.translation,
        )

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        """Return the (4, 4) matrix, so that NumPy functions accept a pose."""
        if copy is False:
            raise ValueError("copy must not be False: the matrix of a pose is always a copy")
        return self.matrix.astype(dtype, copy=False)

    def inverse(self) -> "Pose":
        """Return the inverse transform."""
        return Pose._of_poses(self.rotation.T, -self.rotation.T.dot(self.translation))

    def retract(self, step: Vector) -> "Pose":
        """Return this pose followed by a small step ``(rho, phi)`` in the target frame."""
        increment = exp_rotation(step[3:])
        rotation = increment.dot(self.rotation)
        # Long chains of products lose orthonormality. One Newton step to the nearest rotation
        # (Higham 1986) squares the rounding error.
        rotation = 1.5 * rotation - 0.5 * rotation.dot(rotation.T.dot(rotation))
        return Pose._of_poses(rotation, increment.dot(self.translation) + step[:3])

    def perturbed(self, step: Vector) -> "Pose":
        """Return the perturbed pose ``[exp(phi) R, t + rho]`` for a step ``(rho, phi)`` [m, rad].

        Unlike in `retract`, the rotation does not change the translation. `PosePrior` and pose
        covariances use this parameterisation.
        """
        return Pose(exp_rotation(step[3:]) @ self.rotation, self.translation + step[:3])

    def difference(self, other: "Pose") -> Vector:
        """Return the (6,) step ``(rho, phi)`` [m, rad] with ``other.perturbed(step) == self``."""
        phi = log_rotation(self.rotation @ other.rotation.T)
        return np.concatenate([self.translation - other.translation, phi])

    def log(self) -> Vector:
        """Return the (6,) step ``(rho, phi)`` [m, rad] with ``Pose.from_step(step) == self``."""
        return np.concatenate([self.translation, log_rotation(self.rotation)])

    def adjoint(self) -> Matrix:
        """Return the (6, 6) adjoint, which maps a step in the source frame to the target frame.

        For small steps ``pose @ Pose.from_step(s) == Pose.from_step(adjoint @ s) @ pose``.
        """
        matrix = np.zeros((6, 6))
        matrix[:3, :3] = matrix[3:, 3:] = self.rotation
        matrix[:3, 3:] = hat(self.translation) @ self.rotation
        return matrix

    def scaled_distance(self, other: "Pose", rotation_scale: float) -> float:
        """Return ``hypot(translation, rotation_scale * angle)`` to another pose [m]."""
        metres, radians = self.distance(other)
        return math.hypot(metres, rotation_scale * radians)

    def distance(self, other: "Pose") -> tuple[float, float]:
        """Return the distance to another pose: translation [m] and rotation angle [rad]."""
        step = self.translation - other.translation
        return math.sqrt(float(step.dot(step))), rotation_angle(self.rotation.T.dot(other.rotation))

    def is_close(self, other: "Pose", *, translation: float, rotation: float) -> bool:
        """Return whether another pose is within `translation` [m] and `rotation` [rad]."""
        metres, radians = self.distance(other)
        return metres <= translation and radians <= rotation

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Pose):
            return NotImplemented
        return bool(
            np.array_equal(self.rotation, other.rotation)
            and np.array_equal(self.translation, other.translation)
        )

    def __hash__(self) -> int:
        return hash((self.rotation.tobytes(), self.translation.tobytes()))

    def __repr__(self) -> str:
        turn = np.degrees(log_rotation(self.rotation))
        lengths, angles = (
            ", ".join(f"{round(float(one), 4) + 0.0:.10g}" for one in part)
            for part in (self.translation, turn)
        )
        return f"Pose([{lengths}] m, [{angles}] deg)"

    def __reduce__(self) -> tuple[Any, ...]:
        return Pose, (np.array(self.rotation), np.array(self.translation))


def _remedy(matrix: Matrix) -> str:
    """Return the defect of a matrix that is not a rotation, and its remedy."""
    with np.errstate(over="ignore", invalid="ignore"):
        volume = float(np.linalg.det(matrix[:3, :3]))
    if volume < 0.0:
        return "it is mirrored; swap or negate an axis of one of the frames"
    scale = float(np.cbrt(volume))
    with np.errstate(over="ignore", invalid="ignore"):
        square = matrix[:3, :3] @ matrix[:3, :3].T / scale**2 if scale > 0.0 else np.zeros((3, 3))
    if np.allclose(square, np.eye(3), atol=0.01) or not matrix[:3, :3].any():
        return f"it is scaled by {scale:.4g}; divide by that, and convert both clouds to metres"
    return "it is sheared; pass a rotation"


def _real_array(name: str, value: ArrayLike, shapes: list[tuple[int, ...]]) -> NDArray[np.float64]:
    """Return a C-contiguous float64 copy of `value`; check its type, shape and finiteness."""
    try:
        raw = np.asarray(value)
        if raw.dtype.kind not in "fiu":
            raise TypeError(f"dtype {raw.dtype}")
        array = np.array(raw, dtype=np.float64, order="C")
    except (TypeError, ValueError) as error:
        raise InvalidInput(f"{name} must hold real numbers: {error}") from error
    if array.shape not in shapes:
        wanted = " or ".join(str(shape) for shape in shapes)
        raise InvalidInput(f"{name} must have shape {wanted}, got {array.shape}")
    if not np.isfinite(array).all():
        raise InvalidInput(f"{name} must be finite, got {array.tolist()}")
    return array
