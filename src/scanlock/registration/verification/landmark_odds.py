"""Log odds of a pose by landmarks: this place, or another one that looks alike.

At the right pose a landmark of one scan is *kept*, where the other scan meets it, or *gone*, where
the other scan looks through it: a few per cent move. At a pose that is off by a period, or in
another place of the same kind, a landmark is kept only if something stands there by chance, or
because the landmarks themselves repeat. How often that is, the scans show: the fraction of the
landmark that is met when it is displaced by the periods of the scans.
"""

import math

import numpy as np

from scanlock.arrays import Matrix, Points, read_only
from scanlock.geometry.pose import Pose
from scanlock.registration.verification.features import VerificationFeatures
from scanlock.registration.verification.landmarks import Landmarks
from scanlock.registration.verification.range_image import RangeImage

MAX_LOG_ODDS = 5.0
"""Log odds from which on landmarks decide. More count no more: landmarks are not independent."""

DECISIVE_LOG_ODDS = 10.0
"""Log odds from which on no other place is looked for: hardly any wrong pose has more, and a right
one of a street has 20 to 100."""

_REACH = 0.4
"""Distance of an obstacle that meets a voxel [m]."""

_MARGIN, _RELATIVE_MARGIN = 0.3, 0.02
"""Margins behind a voxel from which on it is looked through [m], and as a fraction of the range."""

_MIN_VOXELS = 3
"""Minimum number of voxels of a landmark that are met or looked through."""

_MIN_MET, _MIN_THROUGH = 0.7, 0.5
"""Fractions of those voxels from which on a landmark is kept, and gone."""

_PRIOR = 0.3
"""Fraction of a landmark that is met in another place, before any is seen: that of one period."""

_MOVED = 0.08
"""Fraction of landmarks that have moved between the scans; with 1 - _MOVED the bounds of the
fraction of a landmark that is met in another place."""


_MAX_ELSEWHERE = 0.65
"""Fraction of a landmark that is met in another place, up to which it supports a pose. What repeats
that much, such as goods in a rack, would add up to support by numbers alone."""


def landmark_log_odds(
    target: VerificationFeatures, source: VerificationFeatures, pose: Pose, periods: Points
) -> float:
    """Compute the log odds of a pose against other places that look alike.

    Parameters
    ----------
    target, source : VerificationFeatures
        A scan without a range image cannot look through anything; the landmarks of the other one
        are left out.
    pose : Pose
        target_from_source.
    periods : (k, 3) [m]
        Displacements at which both scans match themselves, in the frame of the target.

    Returns
    -------
    float
        Sum over the landmarks of both scans; positive supports the pose. NaN without range images.
    """
    known = [
        _log_odds(landmarks, viewer.landmarks, viewer.range_image, viewer_from_landmarks, shifts)
        for landmarks, viewer, viewer_from_landmarks, shifts in (
            (source.landmarks, target, pose, periods @ pose.rotation),
            (target.landmarks, source, pose.inverse(), periods),
        )
        if viewer.range_image is not None
    ]
    return sum(known) if known else math.nan


def _log_odds(
    landmarks: Landmarks, viewer: Landmarks, image: RangeImage, pose: Pose, shifts: Points
) -> float:
    """Return the log odds by the landmarks of one scan; shifts are in its frame."""
    if landmarks.count == 0:
        return 0.0
    met, through = _sightings(landmarks, viewer, image, pose, shifts)
    told = met + through
    is_told = told >= _MIN_VOXELS
    fractions = met / np.maximum(told, 1.0)
    kept = is_told[0] & (fractions[0] > _MIN_MET)
    gone = is_told[0] & (fractions[0] < 1.0 - _MIN_THROUGH)
    elsewhere = np.where(is_told, fractions, 0.0)[1:].sum(axis=0) + _PRIOR
    elsewhere /= is_told[1:].sum(axis=0) + 1.0
    elsewhere = np.clip(elsewhere, _MOVED, 1.0 - _MOVED)
    supporting = np.log((1.0 - _MOVED) / elsewhere[kept & (elsewhere < _MAX_ELSEWHERE)])
    contradicting = np.log((1.0 - elsewhere[gone]) / _MOVED)
    return float(supporting.sum() - contradicting.sum())


def _sightings(
    landmarks: Landmarks, viewer: Landmarks, image: RangeImage, pose: Pose, shifts: Points
) -> tuple[Matrix, Matrix]:
    """Return how many voxels of each landmark are met, and how many are looked through.

    Two (k + 1, count) arrays; the first rows without displacement.
    """
    displaced = landmarks.voxels + np.vstack([np.zeros(3), shifts])[:, None, :]
    points = read_only(pose.apply(displaced.reshape(-1, 3)))
    is_met = viewer.occupied.meet(points, _REACH)
    distances, measured = image.measured_ranges(points)
    # An empty cell has an infinite range: no return, so nothing was looked through.
    limit = np.where(np.isinf(measured), 0.0, (1.0 - _RELATIVE_MARGIN) * measured - _MARGIN)
    is_through = (distances < limit) & ~is_met
    return landmarks.counts(is_met), landmarks.counts(is_through)
