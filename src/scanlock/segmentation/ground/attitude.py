"""Likely upward directions of a cloud whose z axis may have any direction."""

import math

import numpy as np

from scanlock.arrays import Points, Vector, read_only
from scanlock.segmentation.ground.dominant_planes import SurfaceSample
from scanlock.segmentation.ground.result import Ground, GroundStatus

_MIN_FRACTION, _MAX_BELOW = 0.25, 0.05
"""Fractions of the points on the ground and below it at which it is not doubted (ours).

The ground has 0.2 to 0.6 of the points of spinning lidars, a facade below 0.2. Upside down, a
quarter of the points are below a ground that stands on its trees.
"""

_MIN_ORIGIN_HEIGHT = -0.5
"""Height of the origin above a ground that is not doubted [m] (ours). It is the sensor, or the
middle of a map; the origin of some vehicles lies on the ground."""

_MIN_SCORE_RATIO = 1.3
"""Score of a plane, relative to that of the ground near the z axis, above which it comes first
(ours)."""

_SAME_ANGLE = math.radians(20.0)
"""Angle between two upward directions below which they are the same (ours)."""


Z_AXIS = read_only(np.array([0.0, 0.0, 1.0]))


def angle_between(first: Vector, second: Vector) -> float:
    """Return the angle between two vectors [rad], accurate near 0 and pi."""
    return math.atan2(float(np.linalg.norm(np.cross(first, second))), float(first @ second))


def is_evident(ground: Ground) -> bool:
    """Return whether a ground near the z axis is beyond doubt, so that no other is sought."""
    return bool(
        ground.status is not GroundStatus.NONE
        and ground.is_ground.mean() >= _MIN_FRACTION
        and ground.is_below.mean() <= _MAX_BELOW
        and ground.plane[3] >= _MIN_ORIGIN_HEIGHT
    )


def likely_ups(points: Points, near_z: Ground) -> list[Vector]:
    """Return upward directions of a cloud that are likelier than that of a ground near its z axis.

    Parameters
    ----------
    points : (n, 3) [m]
        Measured points.
    near_z : Ground
        Result of ground segmentation near the z axis.

    Returns
    -------
    list of (3,)
        Normals of dominant planes, best first; none if the ground near the z axis is as likely.
    """
    if len(points) == 0:
        return []
    sample = SurfaceSample.of(points)
    planes = sample.dominant_planes()
    if near_z.status is GroundStatus.NONE or not planes:
        return [one.normal for one in planes]
    if angle_between(planes[0].normal, near_z.up) < _SAME_ANGLE:
        return []
    up, offset = near_z.up, float(near_z.plane[3])
    own = max(sample.score(up, offset), 0.0)
    if sample.score(-up, -offset) > own:
        # The ground is upside down.
        own = 0.0
    return [one.normal for one in planes if one.score > _MIN_SCORE_RATIO * own]
