"""How well two scans agree at a pose."""

import math

import numpy as np

from scanlock.geometry.pose import Pose
from scanlock.kernels.meeting import meeting_gaussians
from scanlock.models.gaussians import Gaussians
from scanlock.objectives.gaussian_scores import GaussiansToGaussians
from scanlock.registration.auto_scan import AutoScan
from scanlock.registration.candidate import UNKNOWN_VIOLATION, Candidate
from scanlock.registration.descents import Descent

_MEETING_SQUARED = 9.0
"""Two parts meet within three standard deviations of their difference."""

_WEIGHT_POWER = 0.25
"""Counts to this power weigh the parts: what is near, and rich in points, may move with the
sensor, and must not outvote the rest."""


def gaussian_overlap(
    target: Gaussians, source: Gaussians, pose: Pose, weight_power: float = 0.5
) -> float:
    """Return the share of the source's Gaussians, by weight, that meet one of the target.

    Two Gaussians meet when the squared Mahalanobis distance of their means, under the sum of
    their covariances, is below 9.
    """
    moved = source.transformed(pose)
    met = meeting_gaussians(
        target.means,
        target.packed_covariances,
        target.widths,
        moved.means,
        moved.packed_covariances,
        source.widths,
        _MEETING_SQUARED,
    )
    squares = source.weights(weight_power) ** 2
    return float(squares[met].sum() / squares.sum())


def score_correlation(
    target: Gaussians, source: Gaussians, pose: Pose, weight_power: float = 0.5
) -> float:
    """Return the D2D score at a pose over the geometric mean of the scans' self-scores.

    In [0, 1]: 1 for a scan with itself. The scores leave out the determinants that would make
    them an inner product, so contrived sets can come out above, and are capped.
    """
    identity = Pose.identity()

    def value(target: Gaussians, source: Gaussians, pose: Pose) -> float:
        both = GaussiansToGaussians(target=target, source=source, weight_power=weight_power)
        return both.linearise(pose).value

    own = value(target, target, identity) * value(source, source, identity)
    return min(1.0, abs(value(target, source, pose)) / float(np.sqrt(own)))


def judged(target: AutoScan, source: AutoScan, descent: Descent) -> Candidate:
    """Return the candidate that a descent ended with."""
    pose = descent.solution.pose
    if not (target.has_parts and source.has_parts):
        return Candidate(pose, descent.maker, math.nan, math.nan, math.nan)
    both = target.parts[-1], source.parts[-1]
    overlap = gaussian_overlap(*both, pose, _WEIGHT_POWER)
    score = score_correlation(*both, pose, _WEIGHT_POWER)
    return Candidate(pose, descent.maker, overlap, score, violation(target, source, pose))


def violation(target: AutoScan, source: AutoScan, pose: Pose) -> float:
    """Return the mean over both scans of the share that lies where the other looked through.

    NaN where neither image can tell anything at all, for want of a sensor at its origin.
    """
    shares = [
        seer.ranges.looked_through(
            seen.parts[-1].means, seer_from_seen, seen.parts[-1].weights(0.0)
        )
        for seer, seen, seer_from_seen in (
            (target, source, pose),
            (source, target, pose.inverse()),
        )
        if seer.ranges is not None
    ]
    if not shares:
        return math.nan
    known = [share for share in shares if not math.isnan(share)]
    # Nothing to see where there should be something is no recommendation either.
    return sum(known) / len(known) if known else UNKNOWN_VIOLATION
