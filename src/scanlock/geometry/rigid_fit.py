"""The rigid motion between paired points, in closed form: singular values or quaternion.

Both methods minimise ``sum w |t_i - (R s_i + T)|^2``, eqs. (1) and (2) of Madhavan and Messina
2003, and agree to rounding. The paper prints ``H = sum (p - p_c)(q - q_c)'`` with p of the model
and q of the data, which carries the model onto the data: the inverse of its own eq. (1). Here H
takes the source first. Neither does the paper look at the determinant, which Arun et al. 1987 do:
where the points lie nearly in a plane the plain product can be a mirror image.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from scanlock.arrays import Matrix, Points, Vector
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation

_LEAST_HOLD = 1e-9
"""Pairs hold a rotation when every axis is held by more than this share of the best held."""


@dataclass(frozen=True, slots=True, eq=False)
class PairMoments:
    """All that a closed form needs to know of weighted pairs.

    Attributes
    ----------
    target_centre, source_centre : (3,) [m]
        Weighted means.
    spread : (3, 3) [m^2]
        Weighted mean of ``(s - source_centre)(t - target_centre)'``, the H of Arun et al. 1987.
    """

    target_centre: Vector
    source_centre: Vector
    spread: Matrix

    @classmethod
    def of(cls, target: Points, source: Points, weights: Vector | None = None) -> "PairMoments":
        """Return the moments of (n, 3) pairs; see `fit_arun` for what is refused."""
        if target.shape != source.shape or target.ndim != 2 or target.shape[1] != 3:
            raise InvalidInput(
                "target and source must have the same shape (n, 3), got "
                f"{target.shape} and {source.shape}"
            )
        shares = _shares(weights, len(target))
        target_centre, source_centre = shares @ target, shares @ source
        spread = ((source - source_centre) * shares[:, None]).T @ (target - target_centre)
        return cls(target_centre, source_centre, spread)

    @property
    def holds_rotation(self) -> bool:
        """Whether one rotation fits better than all others: the pairs do not lie on a line."""
        _, sizes, _, sign = self._decomposed()
        # With a mirrored third axis the second and third may cancel: two rotations then tie.
        return bool(sizes[1] + sign * sizes[2] > _LEAST_HOLD * sizes[0])

    @property
    def holds_yaw(self) -> bool:
        """Whether one turn about z fits better than all others."""
        along, across = self._yaw_parts()
        return bool(np.hypot(along, across) > _LEAST_HOLD * np.abs(self.spread).max())

    def by_singular_values(self) -> Pose:
        """Return the pose of `fit_arun`; one of several where the pairs hold no rotation."""
        u, _, vt, sign = self._decomposed()
        return self._centred(vt.T @ np.diag([1.0, 1.0, sign]) @ u.T)

    def by_quaternion(self) -> Pose:
        """Return the pose of `fit_horn`; one of several where the pairs hold no rotation."""
        spread, trace = self.spread, np.trace(self.spread)
        form = np.empty((4, 4))
        form[0, 0] = trace
        form[0, 1:] = form[1:, 0] = [
            spread[1, 2] - spread[2, 1], spread[2, 0] - spread[0, 2], spread[0, 1] - spread[1, 0],
        ]  # fmt: skip
        form[1:, 1:] = spread + spread.T - trace * np.eye(3)
        w, x, y, z = np.linalg.eigh(form)[1][:, -1]
        # fmt: off
        rotation = np.array([
            [1 - 2 * (y * y + z * z),     2 * (x * y - w * z),     2 * (x * z + w * y)],
            [    2 * (x * y + w * z), 1 - 2 * (x * x + z * z),     2 * (y * z - w * x)],
            [    2 * (x * z - w * y),     2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ])
        # fmt: on
        return self._centred(rotation)

    def about_z(self, translation: Literal["xyz", "xy"] = "xyz") -> Pose:
        """Return the pose of `fit_yaw`; one of several where the pairs hold no yaw."""
        along, across = self._yaw_parts()
        turn = exp_rotation(np.array([0.0, 0.0, np.arctan2(across, along)]))
        pose = self._centred(turn)
        return pose if translation == "xyz" else Pose(turn, pose.translation * [1.0, 1.0, 0.0])

    def _decomposed(self) -> tuple[Matrix, Vector, Matrix, float]:
        u, sizes, vt = np.linalg.svd(self.spread)
        return u, sizes, vt, float(np.sign(np.linalg.det(u @ vt)))

    def _yaw_parts(self) -> tuple[float, float]:
        along = self.spread[0, 0] + self.spread[1, 1]
        across = self.spread[0, 1] - self.spread[1, 0]
        return float(along), float(across)

    def _centred(self, rotation: Matrix) -> Pose:
        return Pose(rotation, self.target_centre - rotation @ self.source_centre)


def fit_arun(target: Points, source: Points, weights: Vector | None = None) -> Pose:
    """Return the pose that carries `source` onto `target` with least weighted squared error.

    Parameters
    ----------
    target, source : (n, 3) [m]
        Row k of one belongs to row k of the other; at least three rows that do not lie on a line.
    weights : (n,), optional
        Non-negative; zero drops a pair. Equal by default.

    Raises
    ------
    InvalidInput
        Shapes that do not match, weights that are negative, not finite or all zero, or pairs
        that leave a rotation undetermined.

    Notes
    -----
    Singular values, Arun et al. 1987, with the sign of the determinant put right so that a
    mirror image is never returned.
    """
    return _held(PairMoments.of(target, source, weights)).by_singular_values()


def fit_horn(target: Points, source: Points, weights: Vector | None = None) -> Pose:
    """Return the same pose as `fit_arun` by the unit quaternion of Horn 1987.

    The rotation is the eigenvector of the largest eigenvalue of a 4x4 matrix; it is never a
    mirror image. Parameters and errors are those of `fit_arun`.
    """
    return _held(PairMoments.of(target, source, weights)).by_quaternion()


def fit_yaw(
    target: Points,
    source: Points,
    weights: Vector | None = None,
    *,
    translation: Literal["xyz", "xy"] = "xyz",
) -> Pose:
    """Return the best pose that turns about z only, and moves along xyz or xy only.

    For levelled scanners and flat worlds; singular values and quaternion are here one formula.
    Parameters and errors are those of `fit_arun`; the pairs must not lie on a line along z.
    """
    moments = PairMoments.of(target, source, weights)
    if not moments.holds_yaw:
        raise InvalidInput(
            f"the {len(target)} pairs leave the turn about z undetermined; pairs are needed that "
            "lie apart across z"
        )
    return moments.about_z(translation)


def _shares(weights: Vector | None, count: int) -> Vector:
    if weights is None:
        weights = np.ones(count)
    if weights.shape != (count,):
        raise InvalidInput(f"weights must have shape ({count},), got {weights.shape}")
    total = float(weights.sum())
    if not (np.isfinite(total) and total > 0.0 and bool((weights >= 0.0).all())):
        raise InvalidInput(
            f"weights must be finite, non-negative and not all zero, got a sum of {total:g} over "
            f"{count} pairs"
        )
    return weights / total


def _held(moments: PairMoments) -> PairMoments:
    if not moments.holds_rotation:
        raise InvalidInput(
            "the pairs leave a rotation undetermined: they lie on a line or in one place; pairs "
            "in other directions are needed"
        )
    return moments
