"""Association rules: the target Gaussians that each source Gaussian is scored against.

All rules answer in one form: source i is associated with the targets
``members[starts[k] : starts[k + 1]]`` of its list ``k = lists[i]``, and with none where that is -1.
"""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from scanlock.arrays import Labels, Points, read_only
from scanlock.clouds.point_tree import PointTree
from scanlock.errors import require_count
from scanlock.kernels.gaussians.cells import neighbour_cell_rows
from scanlock.models.voxel_gaussians import VoxelGaussians

Lists = tuple[Labels, Labels, Labels]
"""List of each source (m,), start of each list (l + 1,) and members of all lists."""


class Association(Protocol):
    """A rule that associates Gaussians of the source with Gaussians of the target."""

    def at(self, positions: Points) -> Lists:
        """Return the lists of (m, 3) means of the source, in the target's frame [m]."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class NearestAssociation:
    """The target with the nearest mean (Stoyanov et al. 2012); it changes in jumps."""

    tree: PointTree
    """Search tree of the target's means."""

    def at(self, positions: Points) -> Lists:
        """Return a list with one member for each position."""
        rows, _ = self.tree.nearest(positions)
        count = len(positions)
        return (
            read_only(np.arange(count)),
            read_only(np.arange(count + 1)),
            read_only(self.tree.rows[rows]),
        )


@dataclass(frozen=True, slots=True, eq=False)
class NeighbourCells:
    """The targets in the cells around a position; they change in jumps."""

    voxels: VoxelGaussians
    """Gaussians of the target by cell."""

    max_offset: int = field(default=2)
    """Maximum distance along each axis [cells]; 2 in the published code of Stoyanov et al."""

    def __post_init__(self) -> None:
        require_count("max_offset", self.max_offset, 0)

    def at(self, positions: Points) -> Lists:
        """Return the targets in the cells around each position."""
        voxels, around = self.voxels, self.max_offset
        starts, members = neighbour_cell_rows(
            read_only(positions), voxels.table, voxels.cells, voxels.corner, voxels.size, around
        )
        return read_only(np.arange(len(positions))), read_only(starts), read_only(members)
