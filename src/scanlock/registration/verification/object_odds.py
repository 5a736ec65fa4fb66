"""Log odds of a pose by low objects: this place, or a look-alike.

At the right pose an object of one scan is *confirmed* if the other scan has points there, and
*missing* if it is in the free space of the other scan: a few per cent move. At a pose that is off
by a period, or in another place of the same kind, an object is confirmed by chance only, or because
the objects repeat themselves. The scans show the frequency of that: the fraction of the object that
is confirmed after each motion at which the scans correlate with themselves.
"""

import math
from collections.abc import Sequence

import numpy as np

from scanlock.arrays import Matrix, Points, read_only
from scanlock.geometry.pose import Pose
from scanlock.registration.verification.features import VerificationFeatures
from scanlock.registration.verification.low_objects import LowObjects

MIN_LOG_ODDS, MAX_LOG_ODDS = -3.0, 1.0
"""Log odds between which the feature of the probability lies. Objects are not independent, so that
larger numbers say no more; and scans without objects must not count as wrong."""

DECISIVE_LOG_ODDS = 10.0
"""Log odds above which no other place is searched for: hardly any wrong pose has more, and a
correct one of a street has 20 to 100."""

_REACH = 0.4
"""Maximum distance of a voxel and the obstacle that confirms it [m]."""

_MARGIN, _RELATIVE_MARGIN = 0.3, 0.02
"""Margins between a voxel in free space and the range behind it [m], and relative to the range."""

_MIN_VOXELS = 3
"""Minimum number of observed voxels of an object: confirmed, or in free space."""

_MIN_CONFIRMED, _MIN_FREE = 0.7, 0.5
"""Minimum fractions of those voxels of a confirmed object, and of a missing one."""

_PRIOR = 0.3
"""Fraction of an object confirmed in another place, of the weight of one motion."""

_MOVED = 0.08
"""Fraction of objects that move between two scans. It bounds the fraction confirmed in another
place from below, and 1 - _MOVED from above."""


_MAX_ELSEWHERE = 0.5
"""Maximum fraction confirmed in another place of an object that supports a pose. Objects that
repeat more, such as goods in a rack, would support any pose by their number."""


def object_log_odds(
    target: VerificationFeatures,
    source: VerificationFeatures,
    pose: Pose,
    motions: Sequence[Pose],
) -> float:
    """Compute the log odds of a pose against look-alikes of the place.

    Parameters
    ----------
    target, source : VerificationFeatures
        A scan without a range image has no free space; the objects of the other one are left out.
    pose : Pose
        target_from_source.
    motions : sequence of Pose
        Motions at which both scans correlate with themselves, in the frame of the target.

    Returns
    -------
    float
        Sum over the objects of both scans; positive supports the pose. NaN without range images.
    """
    known = [
        _log_odds(objects, viewer, viewer_from_target, target_from_objects, motions)
        for objects, viewer, viewer_from_target, target_from_objects in (
            (source.low_objects, target, Pose.identity(), pose),
            (target.low_objects, source, pose.inverse(), Pose.identity()),
        )
        if viewer.range_image is not None
    ]
    return sum(known) if known else math.nan


def _log_odds(
    objects: LowObjects,
    viewer: VerificationFeatures,
    viewer_from_target: Pose,
    target_from_objects: Pose,
    motions: Sequence[Pose],
) -> float:
    """Return the log odds by the objects of one scan."""
    if objects.count == 0:
        return 0.0
    in_target = target_from_objects.apply(objects.voxels)
    moved = np.concatenate([in_target, *(motion.apply(in_target) for motion in motions)])
    confirmed, free = _observed_voxels(objects, viewer, viewer_from_target.apply(moved))
    observed = confirmed + free
    is_observed = observed >= _MIN_VOXELS
    fractions = confirmed / np.maximum(observed, 1.0)
    is_confirmed = is_observed[0] & (fractions[0] > _MIN_CONFIRMED)
    is_missing = is_observed[0] & (fractions[0] < 1.0 - _MIN_FREE)
    elsewhere = np.where(is_observed, fractions, 0.0)[1:].sum(axis=0) + _PRIOR
    elsewhere /= is_observed[1:].sum(axis=0) + 1.0
    elsewhere = np.clip(elsewhere, _MOVED, 1.0 - _MOVED)
    supporting = np.log((1.0 - _MOVED) / elsewhere[is_confirmed & (elsewhere < _MAX_ELSEWHERE)])
    contradicting = np.log((1.0 - elsewhere[is_missing]) / _MOVED)
    return float(supporting.sum() - contradicting.sum())


def _observed_voxels(
    objects: LowObjects, viewer: VerificationFeatures, points: Points
) -> tuple[Matrix, Matrix]:
    """Return the numbers of confirmed voxels of each object, and of those in free space.

    `points` (r k, 3) [m] are the voxels at r poses in the frame of the viewer; the results are
    (r, count).
    """
    points = read_only(points)
    image = viewer.range_image
    assert image is not None
    is_confirmed = viewer.low_objects.occupied.is_near(points, _REACH)
    distances, measured = image.measured_ranges(points)
    # An empty cell has an infinite range: no return, so no space is known to be free.
    limit = np.where(np.isinf(measured), 0.0, (1.0 - _RELATIVE_MARGIN) * measured - _MARGIN)
    is_free = (distances < limit) & ~is_confirmed
    return objects.counts(is_confirmed), objects.counts(is_free)
