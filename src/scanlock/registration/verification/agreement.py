"""Overlap, score and free-space violation of two scans at a pose."""

import math

from scanlock.geometry.pose import Pose
from scanlock.registration.verification.candidate import MAX_FREE_SPACE_VIOLATION, Candidate
from scanlock.registration.verification.features import VerificationFeatures
from scanlock.registration.verification.overlap import overlap_and_score


def candidate_at(
    target: VerificationFeatures, source: VerificationFeatures, pose: Pose, proposed_by: str
) -> Candidate:
    """Evaluate a pose as a candidate."""
    overlap, target_overlap, score = overlap_and_score(
        target.gaussians, source.gaussians, pose, (target.self_score, source.self_score)
    )
    return Candidate(
        target_from_source=pose,
        proposed_by=proposed_by,
        overlap=overlap,
        target_overlap=target_overlap,
        score=score,
        free_space_violation=free_space_violation(target, source, pose),
    )


def free_space_violation(
    target: VerificationFeatures, source: VerificationFeatures, pose: Pose
) -> float:
    """Return the fraction of Gaussians in the free space of the other scan, mean of both scans.

    NaN if neither scan has a range image, that is, if no frame has its origin at the sensor. If
    neither image sees enough Gaussians, the violation is the threshold of a plausible pose.
    """
    ratios = [
        viewer.range_image.free_space_violation(
            other.gaussians.means, viewer_from_other, other.gaussians.weights(0.0)
        )
        for viewer, other, viewer_from_other in (
            (target, source, pose),
            (source, target, pose.inverse()),
        )
        if viewer.range_image is not None
    ]
    if not ratios:
        return math.nan
    known = [ratio for ratio in ratios if not math.isnan(ratio)]
    # Gaussians out of view do not support the pose either.
    return sum(known) / len(known) if known else MAX_FREE_SPACE_VIOLATION
