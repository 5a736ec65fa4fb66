"""Overlap and score of two sets of Gaussians, at a pose and shifted along a direction."""

import math

import numpy as np

from scanlock.arrays import Mask, Vector, read_only
from scanlock.geometry.pose import Pose
from scanlock.kernels.verification.overlap import overlap_masks_and_score
from scanlock.kernels.verification.score_profile import scores_along_direction
from scanlock.models.gaussians import Gaussians
from scanlock.optimisation.objectives.gaussian_scores import ScoreShape

_MAX_SQUARED_DISTANCE = 9.0
"""Maximum squared Mahalanobis distance of two Gaussians that overlap: three standard deviations."""

_WEIGHT_POWER = 0.25
"""Exponent of the point counts in the weights of the Gaussians. Near objects have most points and
may move with the sensor; they must not dominate."""

_SHAPE = ScoreShape()

_PROFILE_SHAPE = ScoreShape(window_start=4.0, window_end=9.0)
"""Score window of shifted scores. Distant pairs add the same to all of them, at a high cost."""

_PROFILE_STEP = 0.25
"""Step of the shifts [m]: the scores of compact Gaussians vanish within two steps."""

_PROFILE_STEPS = 40
"""Number of shifts in either direction."""


def self_score(gaussians: Gaussians) -> float:
    """Return the D2D score of a set of Gaussians with itself."""
    return _overlaps(gaussians, gaussians)[2]


def overlap_and_score(
    target: Gaussians, source: Gaussians, pose: Pose, self_scores: tuple[float, float]
) -> tuple[float, float, float]:
    """Compute the overlap of either scan with the other at a pose, and their normalised score.

    Returns
    -------
    overlap, target_overlap : float
        Weighted fractions of the source's and of the target's Gaussians that overlap a Gaussian
        of the other scan, in [0, 1].
    score : float
        D2D score divided by the geometric mean of the self-scores, in [0, 1]: 1 for identical
        scans. Without the determinants of an inner product, contrived sets can exceed 1; the
        score is capped there.
    """
    overlaps, target_overlaps, score = _overlaps(target, source.transformed(pose))
    if min(self_scores) <= 0.0:
        # A scan without Gaussians overlaps nothing.
        return 0.0, 0.0, 0.0
    return (
        _weighted_fraction(source, overlaps),
        _weighted_fraction(target, target_overlaps),
        min(1.0, score / math.sqrt(self_scores[0] * self_scores[1])),
    )


def shifted_score_ratio(
    target: Gaussians, source: Gaussians, pose: Pose, direction: Vector, min_shift: float
) -> float:
    """Return the best score of the source shifted along a direction, relative to the pose.

    Shifts range from `min_shift` to 10 m, both ways; the best score below `min_shift` counts as
    the score at the pose. NaN if that is zero.
    """
    moved = source.transformed(pose)
    # Targets are sorted along a perpendicular of the direction. The cross product with the axis
    # most perpendicular to it is well conditioned.
    across = np.cross(direction, np.eye(3)[int(np.argmin(np.abs(direction)))]).astype(np.float64)
    across = across / float(np.linalg.norm(across))
    scores = scores_along_direction(
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
        _PROFILE_STEP,
        _PROFILE_STEPS,
        _PROFILE_SHAPE.window_start,
        _PROFILE_SHAPE.window_end,
    )
    shifts = np.abs(np.arange(-_PROFILE_STEPS, _PROFILE_STEPS + 1)) * _PROFILE_STEP
    at_pose = float(scores[shifts < min_shift].max())
    return float(scores[shifts >= min_shift].max()) / at_pose if at_pose > 0.0 else math.nan


def _weighted_fraction(gaussians: Gaussians, selected: Mask) -> float:
    """Return the weight of the selected Gaussians as a fraction of the weight of all."""
    squares = gaussians.weights(_WEIGHT_POWER) ** 2
    return float(squares[selected].sum() / squares.sum())


def _overlaps(target: Gaussians, source: Gaussians) -> tuple[Mask, Mask, float]:
    """Return which source and which target Gaussians overlap one of the other, and the score."""
    return overlap_masks_and_score(
        target.means,
        target.packed_covariances,
        target.max_variances,
        target.weights(_WEIGHT_POWER),
        read_only(np.argsort(target.means[:, 0])),
        source.means,
        source.packed_covariances,
        source.max_variances,
        source.weights(_WEIGHT_POWER),
        _MAX_SQUARED_DISTANCE,
        _SHAPE.window_start,
        _SHAPE.window_end,
    )
