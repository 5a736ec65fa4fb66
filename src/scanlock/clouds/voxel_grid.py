"""Partition of points by a grid of cubes."""

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector, read_only
from scanlock.errors import require_positive
from scanlock.kernels.points.moments import labelled_moments
from scanlock.kernels.points.voxel_sums import moments_of_sums, voxel_sums
from scanlock.kernels.points.voxels import ascending_keys, occupied_voxels, voxel_middles

_ZERO = read_only(np.zeros(3))


def voxel_labels(points: Points, width: float) -> tuple[Labels, int]:
    """Return the occupied voxel of each (n, 3) point, and how many there are.

    Voxels are cubes of side `width` [m] with a corner at zero, numbered by ascending index.
    """
    labels, cells = voxel_cells(points, width)
    return labels, len(cells)


def voxel_cells(points: Points, width: float, corner: Vector = _ZERO) -> tuple[Labels, Labels]:
    """Return the occupied voxel of each (n, 3) point, and the (m, 3) indices of the voxels.

    Voxels are cubes of side `width` [m], one with its lowest corner at `corner` [m] of index
    (0, 0, 0), numbered by ascending index.
    """
    require_positive("width", width, unit="m")
    labels, cells = occupied_voxels(read_only(points), read_only(corner), float(width))
    order = _ascending(cells)
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))
    return rank[labels], cells[order]


def voxel_moments(
    points: Points, width: float, corner: Vector = _ZERO, least_count: int = 1
) -> tuple[Labels, Labels, Points, Matrix]:
    """Return the voxels with at least `least_count` of (n, 3) points, and their moments.

    Returns
    -------
    cells : (m, 3)
        As those of `voxel_cells`, ascending.
    counts : (m,)
    means : (m, 3) [m]
    packed : (m, 6) [m^2]
        Upper triangles of the covariances, divided by the counts.
    """
    require_positive("width", width, unit="m")
    points, corner = read_only(points), read_only(corner)
    fits, keys, sums = voxel_sums(points, corner, float(width), least_count)
    if not fits:
        return _scattered_moments(points, width, corner, least_count)
    order = read_only(np.argsort(keys))
    return moments_of_sums(order, read_only(keys), read_only(sums), corner, float(width))


def voxel_means(points: Points, width: float) -> Points:
    """Return the mean of the points in each occupied voxel, (m, 3) with m <= n."""
    require_positive("width", width, unit="m")
    points = read_only(points)
    labels, cells = occupied_voxels(points, _ZERO, float(width))
    return voxel_middles(points, read_only(labels), len(cells))[_ascending(cells)]


def _scattered_moments(
    points: Points, width: float, corner: Vector, least_count: int
) -> tuple[Labels, Labels, Points, Matrix]:
    """Return the same as `voxel_moments`, however far voxels lie from the corner."""
    labels, cells = voxel_cells(points, width, corner)
    counts, means, packed = labelled_moments(points, read_only(labels), len(cells))
    kept = counts >= least_count
    return cells[kept], counts[kept], means[kept], packed[kept]


def _ascending(cells: Labels) -> Labels:
    """Return the order of distinct (m, 3) indices: by the first, then the next."""
    keys = ascending_keys(read_only(cells))
    return np.argsort(keys) if len(keys) else np.lexsort(cells.T[::-1])
