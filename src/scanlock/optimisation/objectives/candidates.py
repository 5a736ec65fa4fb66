"""Which Gaussians of the target each Gaussian of the source is compared with, at a pose.

All answers have one form: source i meets the targets ``members[starts[l] : starts[l + 1]]`` of
its list ``l = lists[i]``, and none where that is -1.
"""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from scanlock.arrays import Labels, Points, read_only
from scanlock.clouds.point_tree import PointTree
from scanlock.errors import require_count
from scanlock.kernels.gaussians.cells import rows_within
from scanlock.models.voxel_gaussians import VoxelGaussians

Lists = tuple[Labels, Labels, Labels]
"""Lists of each source (m,), where they start (l + 1,) and their members."""


class Association(Protocol):
    """A rule of who meets whom."""

    def at(self, places: Points) -> Lists:
        """Return the lists of (m, 3) means of the source in the target's frame [m]."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class NearestAssociation:
    """The one target whose mean is nearest (Stoyanov et al. 2012); it changes in jumps."""

    tree: PointTree
    """Of the target's means."""

    def at(self, places: Points) -> Lists:
        """Return a list of one for every place."""
        rows, _ = self.tree.nearest(places)
        count = len(places)
        return (
            read_only(np.arange(count)),
            read_only(np.arange(count + 1)),
            read_only(self.tree.rows[rows]),
        )


@dataclass(frozen=True, slots=True, eq=False)
class NeighbourCells:
    """The targets at most so many cells away along each axis; they too change in jumps."""

    voxels: VoxelGaussians
    reach: int = field(default=2)
    """2 in the code that Stoyanov et al. published."""

    def __post_init__(self) -> None:
        require_count("reach", self.reach, 0)

    def at(self, places: Points) -> Lists:
        """Return the cells around each place."""
        voxels = self.voxels
        starts, members = rows_within(
            read_only(places), voxels.table, voxels.cells, voxels.corner, voxels.size, self.reach
        )
        return read_only(np.arange(len(places))), read_only(starts), read_only(members)
