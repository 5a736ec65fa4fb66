"""Mean distance of closest points between two scans (Madhavan and Messina 2003).

The measure needs no true pose and does not prove one. On open ground, rows of points also match
when shifted sideways, and points of only one scan keep it above zero at the correct pose.
"""

import math

import numpy as np

from scanlock.arrays import Points, Vector
from scanlock.clouds.point_tree import PointTree
from scanlock.geometry.pose import Pose

_MAX_DEVIATIONS = 3.0
"""Standard deviations above the mean beyond which a distance is an outlier.

The first case of the paper's threshold, for well-aligned scans.
"""


def closest_distances(target: Points, source: Points, pose: Pose) -> Vector:
    """Compute the distance from each source point to the closest target point.

    Parameters
    ----------
    target, source : (n, 3), (m, 3) [m]
    pose : Pose
        Target from source.

    Returns
    -------
    (m,) [m]
        In the order of the source.

    Raises
    ------
    InvalidInput
        A target without points.
    """
    return PointTree.from_points(target).nearest(pose.apply(source))[1]


def inlier_mean(distances: Vector) -> float:
    """Return the mean of the distances that are at most three deviations above their mean.

    Parameters
    ----------
    distances : (m,) [m]

    Returns
    -------
    float [m]
        NaN without distances.
    """
    if len(distances) == 0:
        return math.nan
    threshold = distances.mean() + _MAX_DEVIATIONS * distances.std()
    return float(np.mean(distances[distances <= threshold]))
