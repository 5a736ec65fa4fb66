"""How the parts of two scans meet: who meets whom, the score, and the score of a slid source."""

import math

import numpy as np

from scanlock.arrays import Mask, Vector, read_only
from scanlock.geometry.pose import Pose
from scanlock.kernels.verification.overlap import met_and_score
from scanlock.kernels.verification.score_profile import slid_scores
from scanlock.models.gaussians import Gaussians
from scanlock.optimisation.objectives.gaussian_scores import ScoreShape

_MEETING_SQUARED = 9.0
"""Two parts meet within three standard deviations of their difference."""

_WEIGHT_POWER = 0.25
"""Counts to this power weigh the parts: what is near, and rich in points, may move with the
sensor, and must not outvote the rest."""

_SHAPE = ScoreShape()

_SLIDE_SHAPE = ScoreShape(window_start=4.0, window_end=9.0)
"""Slides are compared by what is near: far pairs add the same everywhere, and cost the time."""

_STEP = 0.25
"""How finely a slide is looked at [m]: scores of sharp parts fall within two such steps."""

_REACH = 40
"""How many steps a slide reaches, either way."""


def self_score(gaussians: Gaussians) -> float:
    """Return the D2D score of a set of Gaussians with itself."""
    return _met(gaussians, gaussians)[2]


def overlaps_and_score(
    target: Gaussians, source: Gaussians, pose: Pose, self_scores: tuple[float, float]
) -> tuple[float, float, float]:
    """Return how much of either scan meets the other at a pose, and how well.

    Returns
    -------
    overlap, target_overlap : float
        Shares of the source's and of the target's Gaussians, by weight, that meet one of the
        other's, in [0, 1]: the squared Mahalanobis distance of their means, under the sum of
        their covariances, is below 9.
    score : float
        The D2D score over the geometric mean of the scans' self-scores, in [0, 1]: 1 for a scan
        with itself. The scores leave out the determinants that would make them an inner product,
        so contrived sets can come out above, and are capped.
    """
    met, met_targets, score = _met(target, source.transformed(pose))
    return (
        _share(source, met),
        _share(target, met_targets),
        min(1.0, score / math.sqrt(self_scores[0] * self_scores[1])),
    )


def slide_ratio(
    target: Gaussians, source: Gaussians, pose: Pose, direction: Vector, least: float
) -> float:
    """Return the best score of the source slid along a direction, as a share of that at the pose.

    Of slides from `least` up to 10 m either way; what scores best nearer than that counts as the
    pose. NaN where nothing meets at the pose.
    """
    moved = source.transformed(pose)
    # Any direction at right angles will do to sort by; the axis most across gives a sound one.
    across = np.cross(direction, np.eye(3)[int(np.argmin(np.abs(direction)))]).astype(np.float64)
    across = across / float(np.linalg.norm(across))
    scores = slid_scores(
        target.means,
        target.packed_covariances,
        target.max_variances,
        target.weights(_WEIGHT_POWER),
        read_only(np.argsort(target.means @ across)),
        moved.means,
        moved.packed_covariances,
        moved.max_variances,
        moved.weights(_WEIGHT_POWER),
        read_only(np.ascontiguousarray(direction)),
        read_only(across),
        _STEP,
        _REACH,
        _SLIDE_SHAPE.window_start,
        _SLIDE_SHAPE.window_end,
    )
    slides = np.abs(np.arange(-_REACH, _REACH + 1)) * _STEP
    own = float(scores[slides < least].max())
    return float(scores[slides >= least].max()) / own if own > 0.0 else math.nan


def _share(gaussians: Gaussians, met: Mask) -> float:
    squares = gaussians.weights(_WEIGHT_POWER) ** 2
    return float(squares[met].sum() / squares.sum())


def _met(target: Gaussians, source: Gaussians) -> tuple[Mask, Mask, float]:
    return met_and_score(
        target.means,
        target.packed_covariances,
        target.max_variances,
        target.weights(_WEIGHT_POWER),
        read_only(np.argsort(target.means[:, 0])),
        source.means,
        source.packed_covariances,
        source.max_variances,
        source.weights(_WEIGHT_POWER),
        _MEETING_SQUARED,
        _SHAPE.window_start,
        _SHAPE.window_end,
    )
