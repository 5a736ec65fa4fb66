"""The rigid motion between two frames, and the conventions that all of scanlock keeps.

======================= ==========================================================================
roles                   ``target`` stays, ``source`` moves (the papers' reference and scene)
transforms              ``a_from_b``; chains cancel: ``a_from_c = a_from_b @ b_from_c``
angles, lengths         radians and metres; degrees only at the command line and in reports, where
                        the name ends in ``_deg``
step vector             ``(rho, phi)``: translation first, as in the papers; SciPy has it the other
                        way round
retraction              ``y -> exp(phi) y + rho`` for a point ``y`` already in the target frame;
                        its Jacobian is ``[I, -hat(y)]``; `Pose.retract`
perturbation            ``[R, t] -> [exp(phi) R, t + rho]``, a rotation about the origin of the
                        source; of priors, covariances and refinement; `Pose.perturbed`
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
"""How far a given matrix may be from a rotation before it is refused rather than mended.

Printed matrices of a few digits are off by 1e-6 to 1e-3; scale or shear is off by far more.
"""

_ROUNDING = 1e-6
"""How far products of a rotation with its transpose may be from the identity.

Long chains in float64 stay below 1e-12; a rotation stored in float32 is off by 1e-7.
"""


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """A rigid motion ``x -> rotation @ x + translation``.

    Attributes
    ----------
    rotation : (3, 3)
        Orthonormal with determinant +1; read-only.
    translation : (3,) [m]
        Read-only.

    Raises
    ------
    InvalidInput
        Wrong shape, NaN or Inf, or a rotation that is off by more than rounding;
        `Pose.from_matrix` mends what was printed with few digits.
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
                "Pose.from_matrix mends one that is slightly off"
            )

    def _is_rotation(self) -> bool:
        # Huge numbers would overflow in the products, and are none of a rotation's.
        if np.abs(self.rotation).max() > 1.0 + _ROUNDING:
            return False
        gap = float(np.abs(self.rotation @ self.rotation.T - np.eye(3)).max())
        return gap <= _ROUNDING and np.linalg.det(self.rotation) > 0.0

    @classmethod
    def _of_poses(cls, rotation: Matrix, translation: Vector) -> "Pose":
        """Return a pose whose parts were computed of those of poses, and need no check."""
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
        """Return the motion that moves nothing."""
        return cls(np.eye(3), np.zeros(3))

    @classmethod
    def from_matrix(cls, matrix: ArrayLike, name: str = "pose") -> "Pose":
        """Return the pose of a (4, 4) or (3, 4) homogeneous matrix.

        A rotation part that is slightly off (printed with few digits) is replaced by the
        nearest rotation.

        Raises
        ------
        InvalidInput
            Wrong shape, NaN, a last row other than (0, 0, 0, 1), or a 3x3 part that is no
            rotation (scaled, sheared or mirrored); `name` says what the matrix is.
        """
        array = _real_array(name, matrix, [(4, 4), (3, 4)])
        if array.shape == (4, 4) and not np.allclose(array[3], (0, 0, 0, 1), atol=1e-6):
            remedy = "; transpose it" if np.allclose(array[:, 3], (0, 0, 0, 1), atol=1e-6) else ""
            raise InvalidInput(
                f"the last row of a pose must be 0 0 0 1, got {array[3].tolist()} in {name}{remedy}"
            )
        rotation = nearest_rotation(array[:3, :3])
        gap = float(np.abs(rotation - array[:3, :3]).max())
        if gap > _ROTATION_TOLERANCE:
            raise InvalidInput(
                f"the 3x3 part of a pose must be a rotation; that of {name} is {gap:.3g} away from "
                f"the nearest one, of {_ROTATION_TOLERANCE:g} that is mended: {_ailment(array)}"
            )
        return cls(rotation, array[:3, 3])

    @classmethod
    def from_step(cls, step: Vector) -> "Pose":
        """Return the motion ``y -> exp(phi) y + rho`` of a step ``(rho, phi)`` [m, rad]."""
        step = _real_array("step", step, [(6,)])
        return cls._of_poses(exp_rotation(step[3:]), step[:3])

    @property
    def matrix(self) -> Matrix:
        """The (4, 4) homogeneous matrix, a fresh copy."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.rotation
        matrix[:3, 3] = self.translation
        return matrix

    def apply(self, points: Points) -> Points:
        """Return the moved (..., 3) points."""
        points = np.asarray(points)
        if points.ndim == 0 or points.shape[-1] != 3:
            raise InvalidInput(f"points must have shape (..., 3), got {points.shape}")
        return points @ self.rotation.T + self.translation

    @overload
    def __matmul__(self, other: "Pose") -> "Pose": ...
    @overload
    def __matmul__(self, other: NDArray[Any]) -> Points: ...
    def __matmul__(self, other: "Pose | NDArray[Any]") -> "Pose | Points":
        """Compose with a pose, or move (..., 3) points."""
        if not isinstance(other, Pose):
            return self.apply(other)
        return Pose._of_poses(
            self.rotation @ other.rotation, self.rotation @ other.translation + self.translation
        )

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        """Return the (4, 4) matrix, so that NumPy takes a pose where it takes an array."""
        if copy is False:
            raise ValueError("the matrix of a pose is always a copy")
        return self.matrix.astype(dtype, copy=False)

    def inverse(self) -> "Pose":
        """Return the motion back."""
        return Pose._of_poses(self.rotation.T, -(self.rotation.T @ self.translation))

    def retract(self, step: Vector) -> "Pose":
        """Return this pose followed by a small step ``(rho, phi)`` in the target frame."""
        turn = exp_rotation(step[3:])
        rotation = turn @ self.rotation
        # Long chains of products drift off the rotations. One step of Newton's iteration to the
        # nearest one (Higham 1986) squares what rounding left.
        rotation = 1.5 * rotation - 0.5 * (rotation @ (rotation.T @ rotation))
        return Pose._of_poses(rotation, turn @ self.translation + step[:3])

    def perturbed(self, step: Vector) -> "Pose":
        """Return the pose with its origin shifted by ``rho`` and then turned about it by ``phi``.

        Unlike `retract`, the rotation leaves the translation: ``[exp(phi) R, t + rho]``. Steps of
        this kind are those of `PosePrior` and of covariances.
        """
        return Pose(exp_rotation(step[3:]) @ self.rotation, self.translation + step[:3])

    def difference(self, other: "Pose") -> Vector:
        """Return the (6,) step ``(rho, phi)`` [m, rad] with ``other.perturbed(step) == self``."""
        turn = log_rotation(self.rotation @ other.rotation.T)
        return np.concatenate([self.translation - other.translation, turn])

    def log(self) -> Vector:
        """Return the (6,) step ``(rho, phi)`` [m, rad] that `from_step` takes to this pose."""
        return np.concatenate([self.translation, log_rotation(self.rotation)])

    def adjoint(self) -> Matrix:
        """Return the (6, 6) matrix that carries a step of the source's frame into the target's.

        For small steps ``pose @ Pose.from_step(s) == Pose.from_step(adjoint @ s) @ pose``.
        """
        matrix = np.zeros((6, 6))
        matrix[:3, :3] = matrix[3:, 3:] = self.rotation
        matrix[:3, 3:] = hat(self.translation) @ self.rotation
        return matrix

    def scaled_distance(self, other: "Pose", rotation_scale: float) -> float:
        """Return the distance to another pose [m], a rotation counted at `rotation_scale` [m]."""
        metres, radians = self.distance(other)
        return math.hypot(metres, rotation_scale * radians)

    def distance(self, other: "Pose") -> tuple[float, float]:
        """Return how far another pose is: translation [m] and rotation angle [rad]."""
        translation = float(np.linalg.norm(self.translation - other.translation))
        return translation, rotation_angle(self.rotation.T @ other.rotation)

    def is_close(self, other: "Pose", *, translation: float, rotation: float) -> bool:
        """Tell whether another pose lies within ``translation`` [m] and ``rotation`` [rad]."""
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

    def __reduce__(self) -> tuple[Any, ...]:
        return Pose, (np.array(self.rotation), np.array(self.translation))


def _ailment(matrix: Matrix) -> str:
    """Return what is wrong with a matrix that should hold a rotation, and the remedy."""
    with np.errstate(over="ignore", invalid="ignore"):
        volume = float(np.linalg.det(matrix[:3, :3]))
    if volume < 0.0:
        return "it mirrors; swap or negate an axis of one of the frames"
    scale = float(np.cbrt(volume))
    with np.errstate(over="ignore", invalid="ignore"):
        square = matrix[:3, :3] @ matrix[:3, :3].T / scale**2 if scale > 0.0 else np.zeros((3, 3))
    if np.allclose(square, np.eye(3), atol=0.01) or not matrix[:3, :3].any():
        return f"it scales by {scale:.4g}; divide by that, and bring both clouds to metres"
    return "it shears; give a rotation"


def _real_array(name: str, value: ArrayLike, shapes: list[tuple[int, ...]]) -> NDArray[np.float64]:
    """Return a finite C-contiguous float64 copy of `value`, which must have one of `shapes`."""
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
