"""How far an estimated trajectory is from the true one, pose by pose.

All errors are arrays in metres and radians; summaries are the caller's, see `spread`. Poses are
``world from sensor``, in the same order on both sides.
"""

from collections.abc import Sequence
from dataclasses import dataclass
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
"""What is laid together before absolute errors are taken: nothing, the first poses, or all
positions with least squared error (Umeyama 1991, without scale).

Positions on one line leave the turn about it open; the first poses are laid together then. The
closer a drive comes to a line, the less its positions say of that turn, and the larger the
errors of rotation after aligning all of them.
"""


@dataclass(frozen=True, slots=True, eq=False)
class TrajectoryErrors:
    """Errors of some poses or of some pairs of poses.

    Attributes
    ----------
    first, last : (n,)
        Rows of the trajectory that entry k compares; equal for absolute errors.
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
    """Return how far each pose is from the true one.

    Raises
    ------
    InvalidInput
        Trajectories of different lengths, or empty.
    """
    moved = aligned(estimate, truth, alignment)
    rows = np.arange(len(truth))
    return _errors(moved, truth, rows, rows, absolute=True)


def aligned(
    estimate: Sequence[Pose], truth: Sequence[Pose], alignment: Alignment = "first"
) -> list[Pose]:
    """Return the estimated poses, moved as one into the frame of the true ones.

    Raises
    ------
    InvalidInput
        Trajectories of different lengths, or empty.
    """
    _require_paired(estimate, truth)
    if alignment == "first":
        shift = truth[0] @ estimate[0].inverse()
    elif alignment == "all":
        shift = _umeyama(estimate, truth)
    else:
        shift = Pose.identity()
    return [shift @ pose for pose in estimate]


def relative_errors(
    estimate: Sequence[Pose], truth: Sequence[Pose], apart: int = 1
) -> TrajectoryErrors:
    """Return the errors of the motions between poses some rows apart.

    Raises
    ------
    InvalidInput
        Trajectories of different lengths, or too short for one such motion.
    """
    _require_paired(estimate, truth)
    require_count("apart", apart)
    if len(truth) <= apart:
        raise InvalidInput(f"apart must be below the {len(truth)} poses there are, got {apart}")
    first = np.arange(len(truth) - apart)
    return _errors(estimate, truth, first, first + apart, absolute=False)


def kitti_errors(
    estimate: Sequence[Pose], truth: Sequence[Pose], every: int = 10
) -> TrajectoryErrors:
    """Return the errors over 100 to 800 m of path, as the KITTI odometry benchmark takes them.

    From every tenth pose, each length ends at the first pose farther along the true path. The
    benchmark's numbers are the means of ``translations / lengths`` and ``rotations / lengths``.
    `lengths` holds the nominal lengths, which the benchmark divides by. Empty where the path is
    shorter than 100 m.
    """
    _require_paired(estimate, truth)
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
    found = _errors(estimate, truth, *rows, absolute=False)
    return TrajectoryErrors(
        found.first, found.last, found.translations, found.rotations, np.array(nominal, np.float64)
    )


def _errors(
    estimate: Sequence[Pose], truth: Sequence[Pose], first: Labels, last: Labels, *, absolute: bool
) -> TrajectoryErrors:
    along = path_lengths(truth)
    translations, rotations = np.empty(len(first)), np.empty(len(first))
    for k, (i, j) in enumerate(zip(first.tolist(), last.tolist(), strict=True)):
        if absolute:
            gap = truth[i].inverse() @ estimate[i]
        else:
            gap = (truth[i].inverse() @ truth[j]).inverse() @ (estimate[i].inverse() @ estimate[j])
        translations[k] = np.linalg.norm(gap.translation)
        rotations[k] = rotation_angle(gap.rotation)
    return TrajectoryErrors(
        first.astype(np.int64), last.astype(np.int64), translations, rotations,
        along[last] - along[first],
    )  # fmt: skip


def path_lengths(poses: Sequence[Pose]) -> Vector:
    """Return the (n,) length [m] of the way from the first pose to each."""
    places = np.array([pose.translation for pose in poses]).reshape(-1, 3)
    steps = np.linalg.norm(np.diff(places, axis=0, prepend=places[:1]), axis=1)
    return np.cumsum(steps)


def _umeyama(estimate: Sequence[Pose], truth: Sequence[Pose]) -> Pose:
    here, there = (np.array([pose.translation for pose in poses]) for poses in (truth, estimate))
    if not PairMoments.of(here, there).constrains_rotation:
        # Positions on one line, or in one place, leave a turn open: the first pose settles it.
        return truth[0] @ estimate[0].inverse()
    return fit_arun(here, there)


def _require_paired(estimate: Sequence[Pose], truth: Sequence[Pose]) -> None:
    if len(estimate) != len(truth) or len(truth) == 0:
        raise InvalidInput(
            f"estimate and truth must have as many poses, at least one, got {len(estimate)} and "
            f"{len(truth)}"
        )
