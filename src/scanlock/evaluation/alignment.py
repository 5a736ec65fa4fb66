"""Alignment of an estimated trajectory with the true one: rigid, with scale, or none.

Poses are ``world_from_sensor``, and both trajectories list the same scans in the same order.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from scanlock.arrays import Points
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.geometry.rigid_fit import PairMoments

Alignment = Literal["none", "first", "all", "all+scale"]
"""Alignment before absolute errors.

None; of the first poses; of all positions by least squares (Umeyama 1991); or the same with a
scale. Positions on one line do not constrain the rotation about it; the first poses are aligned
then. For a nearly straight drive that rotation is poorly constrained, which increases the rotation
errors after aligning all positions.
"""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Similarity:
    """Rigid transform after a scaling: ``x -> pose(scale * x)``.

    Attributes
    ----------
    pose : Pose
        True world from estimated world.
    scale : float
    """

    pose: Pose
    scale: float = 1.0

    def apply(self, poses: Sequence[Pose]) -> list[Pose]:
        """Return the transformed poses; their rotations are not scaled."""
        if self.scale == 1.0:
            return [self.pose @ pose for pose in poses]
        return [self.pose @ Pose(one.rotation, self.scale * one.translation) for one in poses]


def aligned(
    estimate: Sequence[Pose], truth: Sequence[Pose], alignment: Alignment = "first"
) -> list[Pose]:
    """Return the estimated trajectory, moved into the frame of the true one.

    Parameters
    ----------
    estimate, truth, alignment
        As for `find_alignment`.

    Raises
    ------
    InvalidInput
        Trajectories of different lengths, or empty.
    """
    return find_alignment(estimate, truth, alignment).apply(estimate)


def find_alignment(
    estimate: Sequence[Pose], truth: Sequence[Pose], alignment: Alignment = "first"
) -> Similarity:
    """Compute the transform from the world of the estimate to the true one.

    Parameters
    ----------
    estimate, truth : sequence of Pose
        World from sensor, row by row.
    alignment : {"first", "all", "all+scale", "none"}
        See `Alignment`.

    Returns
    -------
    Similarity

    Raises
    ------
    InvalidInput
        Trajectories of different lengths, or empty.
    """
    require_same_length(estimate, truth)
    if alignment == "none":
        return Similarity(pose=Pose.identity())
    first = truth[0] @ estimate[0].inverse()
    if alignment == "first":
        return Similarity(pose=first)
    target, source = positions(truth), positions(estimate)
    moments = PairMoments.of(target, source)
    fixed = moments.constrains_rotation
    pose = moments.by_singular_values() if fixed else first
    if alignment == "all":
        return Similarity(pose=pose)
    scale = _best_scale(moments, pose, source)
    # A line through all positions fixes the scale, but not the rotation about the line.
    centre, onto = moments.source_centre, moments.target_centre
    if not fixed:
        centre, onto = source[0], target[0]
    moved = onto - pose.rotation @ (scale * centre)
    return Similarity(pose=Pose(pose.rotation, moved), scale=scale)


def positions(poses: Sequence[Pose]) -> Points:
    """Return the (n, 3) translations [m] of poses."""
    return np.array([pose.translation for pose in poses], np.float64).reshape(-1, 3)


def require_same_length(estimate: Sequence[Pose], truth: Sequence[Pose]) -> None:
    """Raise `InvalidInput` unless both have the same number of poses, at least one."""
    if len(estimate) != len(truth) or len(truth) == 0:
        raise InvalidInput(
            "estimate and truth must have the same number of poses, at least one, got "
            f"{len(estimate)} and {len(truth)}"
        )


def _best_scale(moments: PairMoments, pose: Pose, source: Points) -> float:
    """Return the least-squares scale for a given rotation; 1 where it is not determined."""
    spread = float(((source - moments.source_centre) ** 2).sum(axis=1).mean())
    scale = float(np.trace(pose.rotation @ moments.cross_covariance)) / spread if spread else 0.0
    # A negative scale would mirror the trajectory.
    return scale if scale > 0.0 else 1.0
