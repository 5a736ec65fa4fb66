"""Closed-form rigid transform between corresponding points, by SVD or unit quaternion.

Both methods minimise ``sum w |t_i - (R s_i + T)|^2``, eqs. (1) and (2) of Madhavan and Messina
2003, and agree to rounding. The printed ``H = sum (p - p_c)(q - q_c)'``, with p of the model and
q of the data, gives the transform from model to data: the inverse of eq. (1). Here H has the
source first. The paper also omits the sign of the determinant (Arun et al. 1987). Without it,
nearly coplanar points can give a reflection.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from scanlock.arrays import Matrix, Points, Vector
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation

_MIN_CONDITIONING = 1e-9
"""Smallest sum of the two smaller singular values that determines a rotation.

Relative to the largest one.
"""


@dataclass(frozen=True, slots=True, eq=False)
class PairMoments:
    """Weighted first and second moments of corresponding points, the input of the closed forms.

    Attributes
    ----------
    target_centre, source_centre : (3,) [m]
        Weighted means.
    cross_covariance : (3, 3) [m^2]
        Weighted mean of ``(s - source_centre)(t - target_centre)'``, the H of Arun et al. 1987.
    """

    target_centre: Vector
    source_centre: Vector
    cross_covariance: Matrix

    @classmethod
    def of(cls, target: Points, source: Points, weights: Vector | None = None) -> "PairMoments":
        """Compute the moments of (n, 3) corresponding points.

        Parameters and errors are those of `fit_arun`, but undetermined rotations are accepted.
        """
        if target.shape != source.shape or target.ndim != 2 or target.shape[1] != 3:
            raise InvalidInput(
                "target and source must have the same shape (n, 3), got "
                f"{target.shape} and {source.shape}"
            )
        weights = _normalised(weights, len(target))
        target_centre, source_centre = weights @ target, weights @ source
        cross = ((source - source_centre) * weights[:, None]).T @ (target - target_centre)
        return cls(target_centre, source_centre, cross)

    @property
    def constrains_rotation(self) -> bool:
        """Whether the best rotation is unique: the points are not collinear."""
        _, singular, _, sign = self._decomposed()
        # Of a reflection the second and third value may be equal: two rotations then fit equally.
        return bool(singular[1] + sign * singular[2] > _MIN_CONDITIONING * singular[0])

    @property
    def constrains_yaw(self) -> bool:
        """Whether the best rotation about z is unique."""
        cosine, sine = self._yaw_components()
        largest = np.abs(self.cross_covariance).max()
        return bool(np.hypot(cosine, sine) > _MIN_CONDITIONING * largest)

    def by_singular_values(self) -> Pose:
        """Return the pose of `fit_arun`; not unique unless `constrains_rotation`."""
        u, _, vt, sign = self._decomposed()
        return self._centred(vt.T @ np.diag([1.0, 1.0, sign]) @ u.T)

    def by_quaternion(self) -> Pose:
        """Return the pose of `fit_horn`; not unique unless `constrains_rotation`."""
        cross, trace = self.cross_covariance, np.trace(self.cross_covariance)
        form = np.empty((4, 4))
        form[0, 0] = trace
        form[0, 1:] = form[1:, 0] = [
            cross[1, 2] - cross[2, 1], cross[2, 0] - cross[0, 2], cross[0, 1] - cross[1, 0],
        ]  # fmt: skip
        form[1:, 1:] = cross + cross.T - trace * np.eye(3)
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
        """Return the pose of `fit_yaw`; not unique unless `constrains_yaw`."""
        cosine, sine = self._yaw_components()
        rotation = exp_rotation(np.array([0.0, 0.0, np.arctan2(sine, cosine)]))
        pose = self._centred(rotation)
        if translation == "xyz":
            return pose
        return Pose(rotation, pose.translation * [1.0, 1.0, 0.0])

    def _decomposed(self) -> tuple[Matrix, Vector, Matrix, float]:
        u, singular, vt = np.linalg.svd(self.cross_covariance)
        return u, singular, vt, float(np.sign(np.linalg.det(u @ vt)))

    def _yaw_components(self) -> tuple[float, float]:
        """Return the cosine and sine of the best yaw, both times one scale [m^2]."""
        cosine = self.cross_covariance[0, 0] + self.cross_covariance[1, 1]
        sine = self.cross_covariance[0, 1] - self.cross_covariance[1, 0]
        return float(cosine), float(sine)

    def _centred(self, rotation: Matrix) -> Pose:
        return Pose(rotation, self.target_centre - rotation @ self.source_centre)


def fit_arun(target: Points, source: Points, weights: Vector | None = None) -> Pose:
    """Return the least-squares pose from `source` to `target` by singular value decomposition.

    Parameters
    ----------
    target, source : (n, 3) [m]
        Corresponding points by row; at least three that are not collinear.
    weights : (n,), optional
        Non-negative weights; zero removes a correspondence. Equal by default.

    Raises
    ------
    InvalidInput
        Shapes that do not match, weights that are negative, not finite or all zero, or points
        that do not determine the rotation.

    Notes
    -----
    Arun et al. 1987, with the sign of the determinant corrected so that the result is never a
    reflection.
    """
    return _constrained(PairMoments.of(target, source, weights)).by_singular_values()


def fit_horn(target: Points, source: Points, weights: Vector | None = None) -> Pose:
    """Return the pose of `fit_arun`, computed by the unit quaternion of Horn 1987.

    The quaternion is the eigenvector of the largest eigenvalue of a 4x4 matrix, so the result is
    never a reflection. Parameters and errors are those of `fit_arun`.
    """
    return _constrained(PairMoments.of(target, source, weights)).by_quaternion()


def fit_yaw(
    target: Points,
    source: Points,
    weights: Vector | None = None,
    *,
    translation: Literal["xyz", "xy"] = "xyz",
) -> Pose:
    """Return the least-squares pose that rotates about z only and translates in xyz or xy.

    For levelled sensors and planar motion. Parameters and errors are those of `fit_arun`; the
    points must not be collinear along z.
    """
    moments = PairMoments.of(target, source, weights)
    if not moments.constrains_yaw:
        raise InvalidInput(
            f"target and source must determine the rotation about z, got {len(target)} pairs on "
            "a line along z; add correspondences with other x or y"
        )
    return moments.about_z(translation)


def _normalised(weights: Vector | None, count: int) -> Vector:
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


def _constrained(moments: PairMoments) -> PairMoments:
    if not moments.constrains_rotation:
        raise InvalidInput(
            "target and source must determine the rotation, got points on a line or in one place; "
            "add correspondences in other directions"
        )
    return moments
