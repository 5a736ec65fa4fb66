"""A finished pose among those that a search had to choose from, and what speaks for it."""

import math
from dataclasses import dataclass, replace

from scanlock.geometry.pose import Pose


@dataclass(frozen=True, slots=True)
class Candidate:
    """One finished pose.

    Attributes
    ----------
    target_from_source : Pose
        Between the same frames as the pose of the result.
    maker : str
        What proposed it: "initial pose", "heading search", "cluster matching" or "prior".
    overlap : float
        Share of the source's parts that meet a part of the target, in [0, 1]; NaN without parts.
    score : float
        Correlation of the two scans' Gaussians, in [0, 1]; NaN without parts.
    violation : float
        Share of the points of either scan that lie where the other looked through, in [0, 1];
        NaN where that cannot be told.
    """

    target_from_source: Pose
    maker: str
    overlap: float
    score: float
    violation: float

    @property
    def agreement(self) -> float:
        """Overlap times score, less what violates free space, in [0, 1]; 0 without parts."""
        known = 0.0 if math.isnan(self.violation) else self.violation
        return 0.0 if math.isnan(self.score) else self.overlap * self.score * (1.0 - known)

    def at(self, pose: Pose) -> "Candidate":
        """Return the candidate with its pose given between other frames."""
        return replace(self, target_from_source=pose)
