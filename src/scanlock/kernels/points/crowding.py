"""Fraction of points in voxels of many points: a measure of the density of a cloud."""

import numpy as np

from scanlock.arrays import Labels, Points
from scanlock.kernels._compile import helper, kernel
from scanlock.kernels._inline import find_voxel, voxel_slot

_SAMPLE_BITS = 20
"""Bits of the hash by which voxels are sampled; the lowest ones are those of the hash table."""


@helper
def _sampled_voxels(points: Points, voxel_size: float, sampling: int) -> tuple[Labels, int]:
    """Return the indices of the points in sampled voxels, in the first of (n, 3) rows."""
    last = (1 << _SAMPLE_BITS) - 1
    limit = (last + 1) // sampling
    inverse = 1.0 / voxel_size
    voxels = np.empty((points.shape[0], 3), np.int64)
    count = 0
    for p in range(points.shape[0]):
        i = int(np.floor(points[p, 0] * inverse))
        j = int(np.floor(points[p, 1] * inverse))
        k = int(np.floor(points[p, 2] * inverse))
        # Mixed by a product, since low bits of the hash follow the parity of the indices.
        mixed = (voxel_slot(i, j, k, last) * 0x9E3779B1) & 0xFFFFFFFF
        if (mixed >> (32 - _SAMPLE_BITS)) < limit:
            voxels[count, 0], voxels[count, 1], voxels[count, 2] = i, j, k
            count += 1
    return voxels, count


@kernel
def crowded_counts(
    points: Points, voxel_size: float, min_points: int, sampling: int
) -> tuple[int, int]:
    """Count the points in voxels of at least `min_points` points, and all, of a sample of voxels.

    Parameters
    ----------
    points : (n, 3) [m]
    voxel_size : float [m]
    min_points : int
    sampling : int
        Reciprocal of the ratio of the voxels that are counted, with all of their points.

    Returns
    -------
    crowded, total : int
    """
    indices, total = _sampled_voxels(points, voxel_size, sampling)
    size = 16
    while size < 4 * total:
        size *= 2
    table = np.full(size, -1, np.int64)
    voxels, counts = np.empty((total, 3), np.int64), np.zeros(total, np.int64)
    found = 0
    for p in range(total):
        i, j, k = indices[p, 0], indices[p, 1], indices[p, 2]
        slot, row = find_voxel(table, voxels, i, j, k)
        if row < 0:
            row = found
            table[slot] = row
            voxels[row, 0], voxels[row, 1], voxels[row, 2] = i, j, k
            found += 1
        counts[row] += 1
    crowded = 0
    for row in range(found):
        if counts[row] >= min_points:
            crowded += counts[row]
    return crowded, total
