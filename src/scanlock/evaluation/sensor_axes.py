"""Fixed rotation between the sensor frames of two trajectories of the same motion.

If ``b = X a X'`` for all motions a and b, their translations and rotation vectors differ by the
rotation of X alone, up to the lever arm between both sensors. KITTI publishes the poses of the left
camera (x to the right, y down, z forward), not of the laser (x forward, y to the left, z up).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from scanlock.arrays import Matrix, Points
from scanlock.evaluation.alignment import require_same_length
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import log_rotation, rotation_angle

CAMERA_FROM_LASER = Pose(
    np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]), np.zeros(3)
)
"""Nominal axes of KITTI's camera and laser; calib.txt has the exact pose."""

Relation = Literal["same", "truth_camera", "estimate_camera", "rotated", "unclear"]
"""Relation of the two sensor frames.

The same; the truth, or the estimate, in the frame of a camera and the other in that of a laser;
another fixed rotation; or different, with too few rotations to tell which.
"""

_CAMERA_RELATIONS: tuple[tuple[Matrix, Relation], ...] = (
    (CAMERA_FROM_LASER.rotation, "truth_camera"),
    (CAMERA_FROM_LASER.rotation.T, "estimate_camera"),
)

_MAX_ANGLE = np.radians(15.0)
"""Largest deviation from nominal axes [rad]; KITTI's are off by less than one degree."""

_AGREES = 0.8
"""Smallest agreement, at most 1, of motions that one rotation explains."""

_CONTRADICTS = 0.5
"""Agreement without rotation below which the frames differ."""

_MAX_SPACING = 10
"""Largest number of rows between the poses of a motion."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class SensorAxes:
    """Relation of the sensor frames of two trajectories.

    Attributes
    ----------
    relation : str
        See `Relation`.
    truth_from_estimate : (3, 3)
        Best rotation between the frames; meaningful for all relations but "unclear".
    """

    relation: Relation
    truth_from_estimate: Matrix

    @property
    def angle(self) -> float:
        """Angle of the rotation [rad]."""
        return rotation_angle(self.truth_from_estimate)


def compare_axes(estimate: Sequence[Pose], truth: Sequence[Pose]) -> SensorAxes:
    """Find the fixed rotation between the sensor frames of two trajectories.

    Only a clear agreement gives another relation than "same", so that a bad estimate is never
    rotated to fit.

    Parameters
    ----------
    estimate, truth : sequence of Pose
        World from sensor, row by row, in any two worlds.

    Returns
    -------
    SensorAxes

    Raises
    ------
    InvalidInput
        Trajectories of different lengths, or empty.
    """
    require_same_length(estimate, truth)
    spacing = max(1, min(_MAX_SPACING, len(truth) // 4))
    estimated, true = (_motions(poses, spacing) for poses in (estimate, truth))
    moved, turned = (_Agreement.of(a, b) for a, b in zip(estimated, true, strict=True))
    best, conditioning = _rotation(moved.cross + turned.cross)
    relation = _relation(best, moved, turned, is_determined=conditioning > _CONTRADICTS)
    return SensorAxes(relation=relation, truth_from_estimate=best)


def _relation(
    best: Matrix, moved: "_Agreement", turned: "_Agreement", *, is_determined: bool
) -> Relation:
    same = np.eye(3)
    if moved.at(same) > _CONTRADICTS and (not is_determined or turned.at(same) > _CONTRADICTS):
        return "same"
    for axes, camera in _CAMERA_RELATIONS:
        if moved.at(axes) > _AGREES and turned.at(axes) > _AGREES:
            return camera if rotation_angle(axes.T @ best) < _MAX_ANGLE else "rotated"
        if moved.at(axes) > _AGREES and not is_determined:
            return "unclear"
    if is_determined and moved.at(best) > _AGREES and turned.at(best) > _AGREES:
        return "rotated"
    return "same"


@dataclass(frozen=True, slots=True, eq=False)
class _Agreement:
    """Cross moments ``sum b a'`` of two sets of vectors, divided by ``sum |a| |b|``."""

    cross: Matrix

    @classmethod
    def of(cls, a: Points, b: Points) -> "_Agreement":
        total = float((np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1)).sum())
        return cls(b.T @ a / total if total > 0.0 else np.zeros((3, 3)))

    def at(self, rotation: Matrix) -> float:
        """Return the mean cosine between b and the rotated a, weighted by their lengths."""
        return float(np.trace(rotation.T @ self.cross))


def _rotation(cross: Matrix) -> tuple[Matrix, float]:
    """Return the rotation that maximises the agreement, and its smallest conditioning."""
    u, singular, vt = np.linalg.svd(cross)
    sign = float(np.sign(np.linalg.det(u @ vt)))
    return u @ np.diag([1.0, 1.0, sign]) @ vt, float(singular[1] + sign * singular[2])


def _motions(poses: Sequence[Pose], spacing: int) -> tuple[Points, Points]:
    """Return the translations [m] and the rotation vectors [rad] of all motions."""
    rotations = np.array([pose.rotation for pose in poses])
    translations = np.array([pose.translation for pose in poses])
    back = rotations[:-spacing].transpose(0, 2, 1)
    steps = translations[spacing:] - translations[:-spacing]
    moved = (back @ steps[:, :, None])[:, :, 0]
    turned = [log_rotation(rotation) for rotation in back @ rotations[spacing:]]
    return moved, np.array(turned).reshape(-1, 3)


def in_other_frame(poses: Sequence[Pose], other_from_sensor: Pose) -> list[Pose]:
    """Return the poses of another sensor on the same vehicle, in the world of its first scan.

    Parameters
    ----------
    poses : sequence of Pose
        World from sensor, where the world is the frame of the sensor at some pose.
    other_from_sensor : Pose
        Calibration between both sensors.
    """
    sensor_from_other = other_from_sensor.inverse()
    return [other_from_sensor @ pose @ sensor_from_other for pose in poses]
