"""How close two scans lie: the mean distance of closest points (Madhavan and Messina 2003).

The measure needs no true pose, and proves none: rows of points on open ground fit each other as
well a step aside, and what only one scan shows keeps even the right pose from zero.
"""

import math

import numpy as np

from scanlock.arrays import Points, Vector
from scanlock.clouds.point_tree import PointTree
from scanlock.geometry.pose import Pose

_DEVIATIONS = 3.0
"""Pairs farther than the mean by more than so many deviations are spurious: the first case of the
paper's limit, that of scans which are well aligned."""


def closest_distances(target: Points, source: Points, pose: Pose) -> Vector:
    """Return the (m,) distance of each source point, moved, to the closest target point [m].

    Parameters
    ----------
    target, source : (n, 3), (m, 3) [m]
    pose : Pose
        Target from source.

    Raises
    ------
    InvalidInput
        A target without points.
    """
    return PointTree.from_points(target).nearest(pose.apply(source))[1]


def kept_mean(distances: Vector) -> float:
    """Return the mean of the distances up to their mean and three deviations [m]; NaN of none."""
    if len(distances) == 0:
        return math.nan
    limit = distances.mean() + _DEVIATIONS * distances.std()
    return float(np.mean(distances[distances <= limit]))
