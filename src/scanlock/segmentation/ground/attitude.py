"""Upward direction of a cloud whose z axis may have any direction."""

import math

import numpy as np

from scanlock.arrays import Points, Vector, read_only
from scanlock.segmentation.ground.dominant_planes import SurfaceSample
from scanlock.segmentation.ground.result import Ground, GroundStatus

_MIN_FRACTION, _MAX_BELOW = 0.25, 0.05
"""Fractions of the points on the ground and below it at which no other ground is looked for (ours).

The ground has 0.2 to 0.6 of the points of spinning lidars, a facade below 0.2. Upside down, a
quarter of the points are below a ground that stands on its trees.
"""

_MIN_ORIGIN_HEIGHT = -0.5
"""Height of the origin above such a ground [m] (ours). It is the sensor, or the
middle of a map; the origin of some vehicles lies on the ground."""

_MIN_SCORE_RATIO = 1.3
"""Score of a plane, relative to that of the ground near the z axis, above which it comes first
(ours)."""

_MAX_SECOND_RATIO = 0.75
"""Score of the second plane, relative to the best one, above which neither is the ground (ours).

Outdoors it is below 0.7. In rooms it is above 0.7, and walls often have the highest score.
"""

_SAME_ANGLE = math.radians(20.0)
"""Angle between two upward directions below which they are the same (ours)."""


Z_AXIS = read_only(np.array([0.0, 0.0, 1.0]))


def angle_between(first: Vector, second: Vector) -> float:
    """Return the angle between two vectors [rad], accurate near 0 and pi."""
    return math.atan2(float(np.linalg.norm(np.cross(first, second))), float(first @ second))


def is_reliable(ground: Ground) -> bool:
    """Return whether a ground near the z axis is good enough, so that no other is looked for."""
    return bool(
        ground.status is not GroundStatus.NONE
        and ground.is_ground.mean() >= _MIN_FRACTION
        and ground.is_below.mean() <= _MAX_BELOW
        and ground.plane[3] >= _MIN_ORIGIN_HEIGHT
    )


def dominant_up(points: Points, near_z: Ground) -> Vector | None:
    """Return the upward direction of a cloud if it is not that of the ground near its z axis.

    Parameters
    ----------
    points : (n, 3) [m]
        Measured points.
    near_z : Ground
        Result of ground segmentation near the z axis.

    Returns
    -------
    (3,) or None
        Normal of the dominant plane. None without one, or if the ground near the z axis is as
        likely.
    """
    if len(points) == 0:
        return None
    sample = SurfaceSample.of(points)
    planes = sample.dominant_planes()
    if not planes:
        return None
    best = planes[0]
    others = (one for one in planes[1:] if not one.is_other_side_of(best))
    if any(one.score > _MAX_SECOND_RATIO * best.score for one in others):
        return None
    if near_z.status is GroundStatus.NONE:
        return best.normal
    up, offset = near_z.up, float(near_z.plane[3])
    own = sample.score(up, offset)
    is_upside_down = sample.score(-up, -offset) > own
    if angle_between(best.normal, up) < _SAME_ANGLE:
        return None
    return best.normal if is_upside_down or best.score > _MIN_SCORE_RATIO * own else None
