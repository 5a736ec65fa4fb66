"""How crisp a map is: the voxels that its points fill (Das et al. 2013, section VIII-A).

The measure is that of Douillard et al. 2012. Scans that are laid together well fill few voxels,
and every error of registration blurs walls and trunks into more of them. It compares maps of the
same scans only: another place, or more scans, fill other numbers.
"""

from collections.abc import Iterable

import numpy as np

from scanlock.arrays import Points
from scanlock.evaluation.voxel_map import VoxelMap

VOXEL_WIDTH = 0.1
"""Side of the voxels of the paper [m]."""


def crispness(points: Points, width: float = VOXEL_WIDTH) -> int:
    """Return how many voxels the points of a map fill; fewer is crisper.

    Voxels are cubes with a corner at zero. Moving all of a map by whole multiples of `width`
    changes nothing. Any other rigid motion changes the count, and a tilt most, for level ground
    then leaves its one layer of voxels. So compare maps in one frame, from the same first pose:
    between maps that begin elsewhere a small difference means nothing.

    Parameters
    ----------
    points : (n, 3) [m]
    width : float [m]
        Side of a voxel.

    Raises
    ------
    InvalidInput
        Points of another shape, not finite, or farther than a million voxels from zero.
    """
    return streamed_crispness([points], width)


def streamed_crispness(chunks: Iterable[Points], width: float = VOXEL_WIDTH) -> int:
    """Return the crispness of a map that comes in parts, too large to be held at once.

    Only one point of each filled voxel is kept. The result is that of `crispness` for all parts
    at once, whatever their order.
    """
    laid = VoxelMap(width)
    for points in chunks:
        laid.add(np.asarray(points, np.float64))
    return len(laid)
