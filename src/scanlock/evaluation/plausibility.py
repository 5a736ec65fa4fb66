"""Signs that two trajectories are not of the same motion."""

from collections.abc import Sequence

import numpy as np

from scanlock.evaluation.alignment import aligned, positions
from scanlock.evaluation.trajectory_errors import path_lengths
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import rotation_angle

_MIN_EXTENT = 1.0
"""Smallest extent [m] of a trajectory whose shape says anything."""

_MAX_LENGTH_RATIO = 1.25
"""Largest ratio of the path lengths of two trajectories of the same motion."""

_MAX_SHAPE_ERROR = 0.25
"""Largest rmse of aligned positions, relative to the extent."""

_MIN_TURN = np.radians(10.0)
"""Smallest rotation [rad] of one trajectory that the other one must have as well."""


def find_warnings(estimate: Sequence[Pose], truth: Sequence[Pose]) -> list[str]:
    """Return sentences about signs that the two are not of the same motion; empty without any.

    Parameters
    ----------
    estimate, truth : sequence of n Pose
        World from sensor, row by row.

    Raises
    ------
    InvalidInput
        Trajectories of different lengths, or empty.
    """
    found: list[str] = []
    extent = _extent(truth)
    if extent > _MIN_EXTENT:
        lengths = [float(path_lengths(poses)[-1]) for poses in (estimate, truth)]
        if max(lengths) > _MAX_LENGTH_RATIO * min(lengths):
            found.append(
                f"the estimated path is {lengths[0]:.1f} m long, the true one {lengths[1]:.1f} m: "
                "check that both are of the same scans and in metres"
            )
        difference = positions(aligned(estimate, truth, "all")) - positions(truth)
        share = float(np.sqrt((difference**2).sum(axis=1).mean())) / extent
        if share > _MAX_SHAPE_ERROR:
            found.append(
                f"after the best alignment the positions still differ by {100.0 * share:.0f} % of "
                "the extent of the truth: check that both are of the same drive"
            )
    turns = {"estimate": _largest_turn(estimate), "truth": _largest_turn(truth)}
    for name, turn in turns.items():
        if turn == 0.0 and max(turns.values()) > _MIN_TURN:
            found.append(f"the {name} has no rotations: only positions can be compared")
    return found


def _extent(poses: Sequence[Pose]) -> float:
    """Return the rms distance [m] of the positions from their mean."""
    at = positions(poses)
    return float(np.sqrt(((at - at.mean(axis=0)) ** 2).sum(axis=1).mean()))


def _largest_turn(poses: Sequence[Pose]) -> float:
    """Return the largest rotation [rad] from the first pose to another."""
    first = poses[0].rotation.T
    return max(rotation_angle(first @ pose.rotation) for pose in poses)
