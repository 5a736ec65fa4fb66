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

_DENSE_CUBE = 0.6
"""Side of the cubes [m] that decide whether a cloud is sparse."""

_SCALE_CUBE = 0.9
"""Side of the cubes [m], at a length scale of 1, that decide the length scale of a sparse cloud."""

_MIN_POINTS = 6
"""Minimum number of points of a crowded cube: those of a Gaussian."""

_MIN_CROWDED_RATIO = 0.1
"""Minimum ratio of the points in crowded cubes. The density of a scan from one position falls with
the square of the range, so its dense part decides: in real scans of vehicles 0.37 to 0.96 of the
points lie in crowded cubes of 0.6 m. In clouds of one density the ratio rises from 0 to 1 within a
factor of two of the size."""

_SAMPLE = 8192
"""Number of points about which a larger cloud is measured, by all points of some of its cubes."""


def is_sparse(points: Points) -> bool:
    """Return whether hardly any cube of 0.6 units has the points of a Gaussian.

    Parameters
    ----------
    points : (n, 3)
        Measured points.
    """
    return not _is_crowded(points, _DENSE_CUBE)


def length_scale_of(points: Points) -> float:
    """Return the smallest length scale at which enough points of a sparse cloud are crowded.

    It is 1 for clouds that are too sparse at every scale.

    Parameters
    ----------
    points : (n, 3) [m]
        Measured points.
    """
    for scale in LENGTH_SCALES:
        if _is_crowded(points, scale * _SCALE_CUBE):
            return scale
    return 1.0


def _is_crowded(points: Points, size: float) -> bool:
    sampling = max(1, len(points) // _SAMPLE)
    crowded, total = crowded_counts(read_only(points), size, _MIN_POINTS, sampling)
    return crowded >= max(1.0, _MIN_CROWDED_RATIO * total)
