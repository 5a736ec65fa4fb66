"""Length scale of a cloud: the factor by which the lengths of all settings grow for sparse clouds.

The lengths of the settings are made for scans whose denser parts have points every few decimetres
or less, as all scans of vehicles and tripods do. A cube of a metre then has the points of a
Gaussian, and a radius of half a metre those of a plane. Airborne clouds have points every metre,
and no such cube. A registration is the same in any unit of length, so the coordinates of such a
cloud are divided by its length scale, and the result is multiplied by it. All lengths follow, those
of the verification too.
"""

from scanlock.arrays import Points, read_only
from scanlock.kernels.points.crowding import crowded_counts

LENGTH_SCALES = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0)
"""Possible length scales. With few of them, two clouds of one sensor mostly share one."""

_CUBE_SIZE = 0.6
"""Side of the cubes [m] at a length scale of 1."""

_MIN_POINTS = 6
"""Minimum number of points of a crowded cube: those of a Gaussian."""

_MIN_CROWDED_RATIO = 0.1
"""Minimum ratio of the points in crowded cubes. The density of a scan from one position falls with
the square of the range, so its dense part decides: real scans of vehicles have 0.37 to 0.96. In
clouds of one density the ratio rises from 0 to 1 within a factor of two of the size."""

_SAMPLE = 8192
"""Number of points about which a larger cloud is measured, by all points of some of its cubes."""


def length_scale_of(points: Points) -> float:
    """Return the smallest length scale at which enough points lie in cubes with enough points.

    It is 1 for dense clouds, and for clouds that are too sparse at every scale.

    Parameters
    ----------
    points : (n, 3) [m]
        Measured points.
    """
    sampling = max(1, len(points) // _SAMPLE)
    for scale in LENGTH_SCALES:
        crowded, total = crowded_counts(
            read_only(points), scale * _CUBE_SIZE, _MIN_POINTS, sampling
        )
        if crowded >= max(1.0, _MIN_CROWDED_RATIO * total):
            return scale
    return 1.0
