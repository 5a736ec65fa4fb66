"""A guess at the pose between two scans, before anything is minimised."""

from collections.abc import Sequence
from dataclasses import dataclass

from scanlock.geometry.pose import Pose


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """Where the source may lie.

    Attributes
    ----------
    pose : Pose
        target_from_source, between the local frames of the clouds.
    weight : float
        How strongly its maker believes in it; comparable within one maker only.
    maker : str
        What proposed it: "heading search", "cluster matching" or "prior".
    """

    pose: Pose
    weight: float
    proposed_by: str


def distinct(poses: Sequence[Pose], metres: float, radians: float) -> list[int]:
    """Return the rows of the poses that lie apart from every one kept before them.

    Two poses lie apart beyond either distance [m, rad].
    """
    kept: list[int] = []
    for row, pose in enumerate(poses):
        if not any(pose.is_close(poses[one], translation=metres, rotation=radians) for one in kept):
            kept.append(row)
    return kept
