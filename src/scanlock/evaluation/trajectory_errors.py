"""Absolute, relative and KITTI errors of an estimated trajectory.

Errors are arrays in metres and radians; summarise them as needed, for example by `box_plot`.
Poses are ``world_from_sensor``, and both trajectories list the same scans in the same order.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from scanlock.arrays import Labels, Vector, frozen
from scanlock.errors import InvalidInput, require_count
from scanlock.geometry.pose import Pose
from scanlock.geometry.rigid_fit import PairMoments, fit_arun
from scanlock.geometry.rotations import rotation_angle

KITTI_LENGTHS = (100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 700.0, 800.0)
"""Path lengths of the KITTI odometry benchmark [m]."""

Alignment = Literal["none", "first", "all"]
"""Alignment before absolute errors: none, of the first poses, or of all positions by least squares
(Umeyama 1991, without scale).

Positions on one line do not constrain the rotation about it; the first poses are aligned then.
For a nearly straight drive that rotation is poorly constrained, which increases the rotation
errors after aligning all positions.
"""


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
    alignment : {"first", "all", "none"}
        See `Alignment`.

    Raises
    ------
    InvalidInput
        Trajectories of different lengths, or empty.
    """
    poses = aligned(estimate, truth, alignment)
    rows = np.arange(len(truth))
    return _errors(poses, truth, rows, rows, absolute=True)


def aligned(
    estimate: Sequence[Pose], truth: Sequence[Pose], alignment: Alignment = "first"
) -> list[Pose]:
    """Return the estimated trajectory, rigidly moved into the frame of the true one.

    Parameters
    ----------
    estimate, truth, alignment
        As for `absolute_errors`.

    Raises
    ------
    InvalidInput
        Trajectories of different lengths, or empty.
    """
    _require_same_length(estimate, truth)
    if alignment == "first":
        motion = truth[0] @ estimate[0].inverse()
    elif alignment == "all":
        motion = _umeyama(estimate, truth)
    else:
        motion = Pose.identity()
    return [motion @ pose for pose in estimate]


def relative_errors(
    estimate: Sequence[Pose], truth: Sequence[Pose], step: int = 1
) -> TrajectoryErrors:
    """Compute the errors of the motions from each pose to the one `step` rows later.

    Parameters
    ----------
    estimate, truth : sequence of Pose
        World from sensor, row by row.
    step : int
        Rows between the two poses of a motion.

    Raises
    ------
    InvalidInput
        Trajectories of different lengths, or with `step` poses or fewer.
    """
    _require_same_length(estimate, truth)
    require_count("step", step)
    if len(truth) <= step:
        raise InvalidInput(f"step must be below the number of poses, {len(truth)}, got {step}")
    first = np.arange(len(truth) - step)
    return _errors(estimate, truth, first, first + step, absolute=False)


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
    _require_same_length(estimate, truth)
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
    positions = np.array([pose.translation for pose in poses]).reshape(-1, 3)
    steps = np.linalg.norm(np.diff(positions, axis=0, prepend=positions[:1]), axis=1)
    return np.cumsum(steps)


def _umeyama(estimate: Sequence[Pose], truth: Sequence[Pose]) -> Pose:
    target, source = (np.array([pose.translation for pose in poses]) for poses in (truth, estimate))
    if not PairMoments.of(target, source).constrains_rotation:
        # Collinear or coincident positions do not constrain the rotation; the first poses do.
        return truth[0] @ estimate[0].inverse()
    return fit_arun(target, source)


def _require_same_length(estimate: Sequence[Pose], truth: Sequence[Pose]) -> None:
    if len(estimate) != len(truth) or len(truth) == 0:
        raise InvalidInput(
            "estimate and truth must have the same number of poses, at least one, got "
            f"{len(estimate)} and {len(truth)}"
        )
