"""A hypothesis: a coarse pose between two scans, proposed without an initial pose."""

from collections.abc import Sequence
from dataclasses import dataclass

from scanlock.geometry.pose import Pose


@dataclass(frozen=True, kw_only=True, slots=True)
class Hypothesis:
    """A pose to be refined.

    Attributes
    ----------
    pose : Pose
        target_from_source, between the local frames of the clouds.
    score : float
        Score of the search that proposed it; comparable within one search only.
    proposed_by : str
        Its origin: "BEV correlation", "cluster matching" or "prior".
    """

    pose: Pose
    score: float
    proposed_by: str


def distinct_rows(poses: Sequence[Pose], translation: float, rotation: float) -> list[int]:
    """Return the rows of the poses that differ from all poses selected before them.

    Two poses differ if they are farther apart than `translation` [m] or `rotation` [rad].
    """
    selected: list[int] = []
    for row, pose in enumerate(poses):
        if not any(
            pose.is_close(poses[one], translation=translation, rotation=rotation)
            for one in selected
        ):
            selected.append(row)
    return selected
