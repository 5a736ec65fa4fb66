"""A finished pose among those that a search had to choose from, and what speaks for it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from scanlock.geometry.pose import Pose

INITIAL = "initial pose"
"""The maker of candidates that the caller asked for."""

HALVING_VIOLATION = 0.15
"""A violation that halves what speaks for a pose, and what is put where too little can be seen.

Right poses of 238 pairs of scans had up to 0.14."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """One finished pose.

    Attributes
    ----------
    target_from_source : Pose
        Between the same frames as the pose of the result.
    maker : str
        What proposed it: "heading search", "cluster matching", "prior", "initial pose", or
        "identity" where none of these led anywhere.
    overlap : float
        Share of the source's parts that meet a part of the target, in [0, 1].
    target_overlap : float
        Share of the target's parts that meet a part of the source, in [0, 1].
    score : float
        Correlation of the two scans' Gaussians, in [0, 1].
    violation : float
        Share of the parts of either scan that lie where the other one looked through, in [0, 1];
        NaN where that cannot be told.

    `scanlock.registration.verification.metrics.Metrics` says exactly what the numbers are.
    """

    target_from_source: Pose
    proposed_by: str
    overlap: float
    target_overlap: float
    score: float
    violation: float

    @property
    def agreement(self) -> float:
        """Overlap times score times plausibility, in [0, 1]."""
        return self.overlap * self.score * plausibility(self.violation)

    @property
    def is_plausible(self) -> bool:
        """Whether it violates free space as little as right poses do, or none can tell."""
        return math.isnan(self.violation) or self.violation < HALVING_VIOLATION

    def at(self, pose: Pose) -> "Candidate":
        """Return the candidate with its pose given between other frames."""
        return replace(self, target_from_source=pose)


def plausibility(violation: float) -> float:
    """Return a factor to what speaks for a pose: 1 without violation, a half at 0.15.

    Cars that moved are few, and walls in the open many.
    """
    return 1.0 if math.isnan(violation) else 1.0 / (1.0 + violation / HALVING_VIOLATION)


def runner_up_ratio(candidates: Sequence[Candidate]) -> float:
    """Return the agreement of the best rival of the first candidate as a share of its own.

    0 where there is no rival; NaN where nothing was judged.
    """
    if not candidates or candidates[0].agreement <= 0.0:
        return math.nan
    rivals = [one.agreement for one in candidates[1:]]
    return max(rivals, default=0.0) / candidates[0].agreement
