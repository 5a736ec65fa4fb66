"""How well two scans agree at a pose."""

import math

import numpy as np

from scanlock.arrays import Mask, read_only
from scanlock.geometry.pose import Pose
from scanlock.kernels.meeting import met_and_score
from scanlock.models.gaussians import Gaussians
from scanlock.objectives.gaussian_scores import ScoreShape
from scanlock.registration.auto_scan import AutoScan
from scanlock.registration.candidate import UNKNOWN_VIOLATION, Candidate
from scanlock.registration.descents import Descent

_MEETING_SQUARED = 9.0
"""Two parts meet within three standard deviations of their difference."""

_WEIGHT_POWER = 0.25
"""Counts to this power weigh the parts: what is near, and rich in points, may move with the
sensor, and must not outvote the rest."""


def overlap_and_score(
    target: Gaussians, source: Gaussians, pose: Pose, weight_power: float = 0.5
) -> tuple[float, float]:
    """Return how much of the source meets the target at a pose, and how well.

    Counts to `weight_power` weigh the Gaussians.

    Returns
    -------
    overlap : float
        Share of the source's Gaussians, by weight, that meet one of the target, in [0, 1]: the
        squared Mahalanobis distance of their means, under the sum of their covariances, is
        below 9.
    score : float
        The D2D score over the geometric mean of the scans' self-scores, in [0, 1]: 1 for a scan
        with itself. The scores leave out the determinants that would make them an inner product,
        so contrived sets can come out above, and are capped.
    """
    met, score = _met_and_score(target, source.transformed(pose), weight_power)
    own = [_met_and_score(scan, scan, weight_power)[1] for scan in (target, source)]
    squares = source.weights(weight_power) ** 2
    return float(squares[met].sum() / squares.sum()), min(1.0, score / math.sqrt(own[0] * own[1]))


def _met_and_score(target: Gaussians, source: Gaussians, weight_power: float) -> tuple[Mask, float]:
    shape = ScoreShape()
    return met_and_score(
        target.means,
        target.packed_covariances,
        target.widths,
        target.weights(weight_power),
        read_only(np.argsort(target.means[:, 0])),
        source.means,
        source.packed_covariances,
        source.widths,
        source.weights(weight_power),
        _MEETING_SQUARED,
        shape.window_start,
        shape.window_end,
    )


def judged(target: AutoScan, source: AutoScan, descent: Descent) -> Candidate:
    """Return the candidate that a descent ended with."""
    pose = descent.solution.pose
    if not (target.has_parts and source.has_parts):
        return Candidate(pose, descent.maker, math.nan, math.nan, math.nan)
    both = target.parts[-1], source.parts[-1]
    overlap, score = overlap_and_score(*both, pose, _WEIGHT_POWER)
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
