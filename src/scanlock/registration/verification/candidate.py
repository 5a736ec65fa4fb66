"""Candidate poses of a search, with the numbers that rank them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from scanlock.arrays import short_repr
from scanlock.geometry.pose import Pose

INITIAL = "initial pose"
"""Value of `Candidate.proposed_by` for candidates refined from the caller's initial pose."""

MAX_FREE_SPACE_VIOLATION = 0.15
"""Free-space violation from which a pose is implausible; its plausibility is then one half.
Correct poses of 238 real pairs have up to 0.14."""

MAX_RULED_OUT = 0.3
"""Probability below which a candidate does not count as a runner-up."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Candidate:
    """A refined pose with its overlap, score and free-space violation; see `Metrics`.

    Attributes
    ----------
    target_from_source : Pose
        The pose, between the same frames as the pose of the result.
    proposed_by : str
        Origin of the pose: the name of a search, "prior", "initial pose", or "identity" where
        none of these led to a pose.
    overlap : float
        Weighted fraction of the source's Gaussians that overlap a Gaussian of the target, in
        [0, 1].
    target_overlap : float
        Weighted fraction of the target's Gaussians that overlap a Gaussian of the source, in
        [0, 1].
    score : float
        Normalised D2D score of the two sets of Gaussians, in [0, 1].
    free_space_violation : float
        Fraction of either scan's Gaussians in the free space of the other scan, in [0, 1]; NaN
        if unknown.
    probability : float
        Probability that the pose is right, by its own verification and the prior; NaN if the pose
        was not verified, because no other pose has a similar score.
    """

    target_from_source: Pose
    proposed_by: str
    overlap: float
    target_overlap: float
    score: float
    free_space_violation: float
    probability: float = math.nan

    __repr__ = short_repr

    @property
    def agreement(self) -> float:
        """Product of overlap, score and `plausibility`, in [0, 1]."""
        return self.overlap * self.score * plausibility(self.free_space_violation)

    @property
    def is_plausible(self) -> bool:
        """Whether the free-space violation is below the threshold, or unknown."""
        return (
            math.isnan(self.free_space_violation)
            or self.free_space_violation < MAX_FREE_SPACE_VIOLATION
        )

    @property
    def is_ruled_out(self) -> bool:
        """Whether the verification of the pose itself makes it improbable."""
        return self.probability < MAX_RULED_OUT

    def with_pose(self, pose: Pose) -> "Candidate":
        """Return the candidate with another pose, such as the same pose in other frames."""
        return replace(self, target_from_source=pose)


def plausibility(free_space_violation: float) -> float:
    """Return the plausibility of a free-space violation: 1 for none or NaN, a half at 0.15.

    It falls slowly enough to tolerate moved cars, and far enough to reject walls in free space.
    """
    if math.isnan(free_space_violation):
        return 1.0
    return 1.0 / (1.0 + free_space_violation / MAX_FREE_SPACE_VIOLATION)


def agreement_ratio(candidates: Sequence[Candidate]) -> float:
    """Return the best agreement of the other candidates divided by that of the first.

    Candidates that are ruled out do not count. 0 without others; NaN without candidates, or if the
    first has no agreement.
    """
    if not candidates or candidates[0].agreement <= 0.0:
        return math.nan
    others = [one.agreement for one in candidates[1:] if not one.is_ruled_out]
    return max(others, default=0.0) / candidates[0].agreement
