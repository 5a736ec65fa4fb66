"""Crispness of a map: its number of occupied voxels (Das et al. 2013, section VIII-A).

The measure is that of Douillard et al. 2012. Registration errors thicken walls and trunks to more
voxels, so fewer is better. It compares maps of the same scans only.
"""

from collections.abc import Iterable

import numpy as np

from scanlock.arrays import Points
from scanlock.evaluation.voxel_map import VoxelMap

VOXEL_SIZE = 0.1
"""Side of the voxels in Das et al. 2013 [m]."""


def crispness(points: Points, voxel_size: float = VOXEL_SIZE) -> int:
    """Count the occupied voxels of a map; fewer is crisper.

    Parameters
    ----------
    points : (n, 3) [m]
    voxel_size : float [m]
        Side of a voxel. One corner of the voxel grid is at zero.

    Raises
    ------
    InvalidInput
        Points of another shape, not finite, or more than a million voxels from zero; a size that
        is not positive.

    Notes
    -----
    Compare maps in one frame, from the same first pose. A shift by whole voxels does not change
    the count, but any other rigid motion does. A change of roll or pitch does most, since level
    ground is then no longer in one layer of voxels.
    """
    return streamed_crispness([points], voxel_size)


def streamed_crispness(chunks: Iterable[Points], voxel_size: float = VOXEL_SIZE) -> int:
    """Count the occupied voxels of a map that comes in chunks, too large for memory.

    One point of each occupied voxel is stored. The result equals that of `crispness` for all
    chunks together, whatever their order.

    Parameters
    ----------
    chunks : iterable of (n, 3) [m]
    voxel_size : float [m]

    Raises
    ------
    InvalidInput
        As for `crispness`.
    """
    voxels = VoxelMap(voxel_size)
    for points in chunks:
        voxels.add(np.asarray(points, np.float64))
    return len(voxels)
