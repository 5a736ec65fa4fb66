"""Absolute, relative and KITTI errors of an estimated trajectory.

Errors are arrays in metres and radians; summarise them as needed, for example by `box_plot`.
Poses are ``world_from_sensor``, and both trajectories list the same scans in the same order.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from scanlock.arrays import Labels, Vector, frozen
from scanlock.errors import InvalidInput, require_count
from scanlock.evaluation.alignment import Alignment, aligned, positions, require_same_length
from scanlock.evaluation.pose_pairs import DeltaUnit, pose_pairs
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import rotation_angle

KITTI_LENGTHS = (100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 700.0, 800.0)
"""Path lengths of the KITTI odometry benchmark [m]."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class TrajectoryErrors:
    """Errors of poses, or of motions between pairs of poses.

    Attributes
    ----------
    first, last : (n,)
        Rows of the two poses that entry k compares; equal for absolute errors.
    translations : (n,) [m]
    rotations : (n,) [rad]
    lengths : (n,) [m]
        Path length of the true trajectory between the two rows.
    """

    first: Labels
    last: Labels
    translations: Vector
    rotations: Vector
    lengths: Vector

    def __post_init__(self) -> None:
        for array in (self.first, self.last, self.translations, self.rotations, self.lengths):
            frozen(array)

    def __len__(self) -> int:
        return len(self.translations)


def absolute_errors(
    estimate: Sequence[Pose], truth: Sequence[Pose], alignment: Alignment = "first"
) -> TrajectoryErrors:
    """Compute the error of each pose after alignment.

    Parameters
    ----------
    estimate, truth : sequence of Pose
        World from sensor, row by row.
    alignment : {"first", "all", "all+scale", "none"}
        See `Alignment`.

    Raises
    ------
    InvalidInput
        Trajectories of different lengths, or empty.
    """
    poses = aligned(estimate, truth, alignment)
    rows = np.arange(len(truth))
    return _errors(poses, truth, rows, rows, absolute=True)


def relative_errors(
    estimate: Sequence[Pose],
    truth: Sequence[Pose],
    delta: float = 1.0,
    unit: DeltaUnit = "scans",
    *,
    all_pairs: bool = False,
    times: Vector | None = None,
) -> TrajectoryErrors:
    """Compute the errors of the motions between poses a fixed distance apart.

    Parameters
    ----------
    estimate, truth : sequence of Pose
        World from sensor, row by row.
    delta : float
        Distance between the two poses of a motion.
    unit : {"scans", "m", "s"}
        Unit of `delta`: rows, path length of the truth, or time.
    all_pairs : bool
        Start a motion at each pose instead of at the end of the previous motion; see
        `pose_pairs`.
    times : (n,) [s], optional
        Ascending times of the poses, for the unit "s".

    Raises
    ------
    InvalidInput
        Trajectories of different lengths, no poses that far apart, or no times for the unit "s".
    """
    require_same_length(estimate, truth)
    if unit == "s":
        if times is None or len(times) != len(truth):
            raise InvalidInput(
                "times must be given for a delta in seconds, one per pose; use scans or m"
            )
        steps = np.diff(times)
        if np.any(steps < 0.0):
            raise InvalidInput("times must ascend for a delta in seconds; sort the poses by time")
    else:
        steps = _steps(truth)[1:] if unit == "m" else np.ones(len(truth) - 1)
    first, last = pose_pairs(steps, delta, unit, all_pairs=all_pairs)
    return _errors(estimate, truth, first, last, absolute=False)


def kitti_errors(
    estimate: Sequence[Pose], truth: Sequence[Pose], every: int = 10
) -> TrajectoryErrors:
    """Compute the errors over 100 to 800 m of path, as the KITTI odometry benchmark defines them.

    A segment begins at every tenth pose and ends at the first pose that is farther along the true
    path than the length. The benchmark reports the means of ``translations / lengths`` and
    ``rotations / lengths``.

    Parameters
    ----------
    estimate, truth : sequence of Pose
        World from sensor, row by row.
    every : int
        Rows between the starts of segments.

    Returns
    -------
    TrajectoryErrors
        With the nominal lengths, by which the benchmark divides; empty where the path is shorter
        than 100 m.

    Raises
    ------
    InvalidInput
        Trajectories of different lengths, or empty.
    """
    require_same_length(estimate, truth)
    require_count("every", every)
    along = path_lengths(truth)
    first: list[int] = []
    last: list[int] = []
    nominal: list[float] = []
    for row in range(0, len(truth), every):
        for length in KITTI_LENGTHS:
            end = int(np.searchsorted(along, along[row] + length, side="right"))
            if end < len(truth):
                first.append(row)
                last.append(end)
                nominal.append(length)
    rows = np.array(first, np.int64), np.array(last, np.int64)
    errors = _errors(estimate, truth, *rows, absolute=False)
    return replace(errors, lengths=np.array(nominal, np.float64))


def _errors(
    estimate: Sequence[Pose], truth: Sequence[Pose], first: Labels, last: Labels, *, absolute: bool
) -> TrajectoryErrors:
    along = path_lengths(truth)
    translations, rotations = np.empty(len(first)), np.empty(len(first))
    for k, (i, j) in enumerate(zip(first.tolist(), last.tolist(), strict=True)):
        if absolute:
            error = truth[i].inverse() @ estimate[i]
        else:
            true_motion = truth[i].inverse() @ truth[j]
            error = true_motion.inverse() @ (estimate[i].inverse() @ estimate[j])
        translations[k] = np.linalg.norm(error.translation)
        rotations[k] = rotation_angle(error.rotation)
    return TrajectoryErrors(
        first=first.astype(np.int64),
        last=last.astype(np.int64),
        translations=translations,
        rotations=rotations,
        lengths=along[last] - along[first],
    )


def path_lengths(poses: Sequence[Pose]) -> Vector:
    """Return the path length from the first pose to each pose.

    Parameters
    ----------
    poses : sequence of n Pose
        World from sensor.

    Returns
    -------
    (n,) [m]
    """
    return np.cumsum(_steps(poses))


def _steps(poses: Sequence[Pose]) -> Vector:
    """Return the distance of each pose from the previous one; 0 for the first."""
    at = positions(poses)
    return np.linalg.norm(np.diff(at, axis=0, prepend=at[:1]), axis=1)
