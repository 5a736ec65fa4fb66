"""How well two scans agree at a pose, as far as a search weighs it for each of its candidates."""

import math

from scanlock.geometry.pose import Pose
from scanlock.registration.verification.candidate import HALVING_VIOLATION, Candidate
from scanlock.registration.verification.features import VerificationFeatures
from scanlock.registration.verification.overlap import overlaps_and_score


def candidate_at(
    target: VerificationFeatures, source: VerificationFeatures, pose: Pose, proposed_by: str
) -> Candidate:
    """Return a pose with what speaks for it."""
    overlap, target_overlap, score = overlaps_and_score(
        target.gaussians, source.gaussians, pose, (target.self_score, source.self_score)
    )
    return Candidate(
        pose, proposed_by, overlap, target_overlap, score, violation(target, source, pose)
    )


def violation(target: VerificationFeatures, source: VerificationFeatures, pose: Pose) -> float:
    """Return the mean over both scans of the share that lies where the other looked through.

    NaN where neither image can tell anything at all, for want of a sensor at its origin.
    """
    shares = [
        seer.range_image.free_space_violation(
            seen.gaussians.means, seer_from_seen, seen.gaussians.weights(0.0)
        )
        for seer, seen, seer_from_seen in (
            (target, source, pose),
            (source, target, pose.inverse()),
        )
        if seer.range_image is not None
    ]
    if not shares:
        return math.nan
    known = [ratio for ratio in shares if not math.isnan(ratio)]
    # Nothing to see where there should be something is no recommendation either.
    return sum(known) / len(known) if known else HALVING_VIOLATION
