"""Voxel grids: labels, indices, means and moments of the points in each voxel."""

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector, read_only
from scanlock.errors import require_positive
from scanlock.kernels.points.moments import labelled_moments
from scanlock.kernels.points.voxel_sums import moments_from_sums, voxel_sums
from scanlock.kernels.points.voxels import occupied_voxels, row_major_keys, voxel_centroids

_ZERO = read_only(np.zeros(3))


def voxel_labels(points: Points, voxel_size: float) -> tuple[Labels, int]:
    """Return the occupied voxel of each (n, 3) point, and the number of occupied voxels.

    Voxels have the side `voxel_size` [m] and a corner at the origin; they are numbered by
    ascending index.
    """
    labels, indices = voxel_indices(points, voxel_size)
    return labels, len(indices)


def voxel_indices(
    points: Points, voxel_size: float, corner: Vector = _ZERO
) -> tuple[Labels, Labels]:
    """Return the occupied voxel of each point, and the integer indices of the voxels.

    Parameters
    ----------
    points : (n, 3) [m]
        Points.
    voxel_size : float [m]
        Side of a voxel.
    corner : (3,) [m]
        Lowest corner of the voxel (0, 0, 0).

    Returns
    -------
    labels : (n,)
        Row of `indices` of each point.
    indices : (m, 3)
        Indices of the occupied voxels, ascending.

    Raises
    ------
    InvalidInput
        `voxel_size` is not positive.
    """
    require_positive("voxel_size", voxel_size, unit="m")
    labels, indices = occupied_voxels(read_only(points), read_only(corner), float(voxel_size))
    order = _ascending(indices)
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))
    return rank[labels], indices[order]


def voxel_moments(
    points: Points, voxel_size: float, corner: Vector = _ZERO, min_points: int = 1
) -> tuple[Labels, Labels, Points, Matrix]:
    """Return the moments of the points in each voxel with at least `min_points` points.

    Parameters
    ----------
    points, voxel_size, corner
        As for `voxel_indices`.
    min_points : int
        Minimum number of points of a voxel.

    Returns
    -------
    indices : (m, 3)
        Indices of the voxels, ascending, as those of `voxel_indices`.
    counts : (m,)
        Number of points.
    means : (m, 3) [m]
        Means of the points.
    packed : (m, 6) [m^2]
        Upper triangles of the covariances, divided by the counts.

    Raises
    ------
    InvalidInput
        `voxel_size` is not positive.
    """
    require_positive("voxel_size", voxel_size, unit="m")
    points, corner = read_only(points), read_only(corner)
    fits, keys, sums = voxel_sums(points, corner, float(voxel_size), min_points)
    if not fits:
        return _scattered_moments(points, voxel_size, corner, min_points)
    order = read_only(np.argsort(keys))
    return moments_from_sums(order, read_only(keys), read_only(sums), corner, float(voxel_size))


def voxel_means(points: Points, voxel_size: float) -> Points:
    """Downsample points to their mean in each occupied voxel.

    Parameters
    ----------
    points : (n, 3) [m]
    voxel_size : float [m]

    Returns
    -------
    (m, 3) [m]
        One point per occupied voxel.

    Raises
    ------
    InvalidInput
        `voxel_size` is not positive.
    """
    require_positive("voxel_size", voxel_size, unit="m")
    points = read_only(points)
    labels, indices = occupied_voxels(points, _ZERO, float(voxel_size))
    return voxel_centroids(points, read_only(labels), len(indices))[_ascending(indices)]


def _scattered_moments(
    points: Points, voxel_size: float, corner: Vector, min_points: int
) -> tuple[Labels, Labels, Points, Matrix]:
    """Return the result of `voxel_moments` for voxels at any distance from the corner."""
    labels, indices = voxel_indices(points, voxel_size, corner)
    counts, means, packed = labelled_moments(points, read_only(labels), len(indices))
    is_full = counts >= min_points
    return indices[is_full], counts[is_full], means[is_full], packed[is_full]


def _ascending(indices: Labels) -> Labels:
    """Return the lexicographic order of distinct (m, 3) indices."""
    keys = row_major_keys(read_only(indices))
    return np.argsort(keys) if len(keys) else np.lexsort(indices.T[::-1])
