"""Which Gaussians of the target each Gaussian of the source is compared with, at a pose.

All answers have one form: source i meets the targets ``members[starts[l] : starts[l + 1]]`` of
its list ``l = lists[i]``, and none where that is -1; where there are no lists it meets all.
"""

import math
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector, read_only
from scanlock.clouds.point_tree import PointTree
from scanlock.errors import require_count
from scanlock.geometry.pose import Pose
from scanlock.kernels.cells import rows_within
from scanlock.kernels.reach import targets_in_reach
from scanlock.kernels.tiles import tile_lists
from scanlock.models.gaussians import Gaussians
from scanlock.models.voxel_gaussians import VoxelGaussians

Lists = tuple[Labels, Labels, Labels]
"""Lists of each source (m,), where they start (l + 1,) and their members."""

_NONE = read_only(np.empty(0, np.int64))

_TILE_WIDTH = 3.0
"""Side of the tiles that list the Gaussians in reach [m]; about the size of a cluster."""

_MOST_TILES_A_SIDE = 256
"""Wide maps get wider tiles instead of more memory."""

_SKIN = 0.1
"""Lists reach farther than they must by about this share, and serve poses that much apart.

A tenth adds a quarter to what is listed, and the steps of one descent mostly stay within it.
"""


class Candidates(Protocol):
    """A rule of who meets whom."""

    def at(self, pose: Pose, means: Points) -> Lists:
        """Return the lists at a pose of sources of (m, 3) means [m]."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class EveryTarget:
    """All Gaussians of the target for each of the source (Das et al. 2013)."""

    def at(self, pose: Pose, means: Points) -> Lists:
        """Return no list at all, which stands for everyone."""
        return _NONE, _NONE, _NONE


@dataclass(frozen=True, slots=True, eq=False)
class Tiles:
    """Lists of the Gaussians that reach each square tile of the xy plane.

    Attributes
    ----------
    starts, members : (columns * rows + 1,), (l,)
        Of the list of each tile, row by row.
    corner : (2,) [m]
    width : float [m]
    columns, rows : int
    """

    starts: Labels
    members: Labels
    corner: Vector
    width: float
    columns: int
    rows: int

    @classmethod
    def of(cls, means: Points, radii: Vector) -> "Tiles":
        """Return the tiles of means (k, 3) that reach as far as their radii [m]."""
        low = (means[:, :2] - radii[:, None]).min(axis=0)
        high = (means[:, :2] + radii[:, None]).max(axis=0)
        width = max(_TILE_WIDTH, float((high - low).max()) / _MOST_TILES_A_SIDE)
        columns, rows = (int(count) for count in np.floor((high - low) / width) + 1)
        starts, members = tile_lists(means, radii, low, width, columns, rows)
        return cls(read_only(starts), read_only(members), low, width, columns, rows)


class TargetsInReach:
    """The targets that can score with any source at a pose, and few that cannot.

    As good as `EveryTarget` and faster: a pair is out of reach when its means are farther apart
    than the window allows for the largest variances of either, which no rotation changes. The
    lists reach a little farther and are kept, as those of Verlet 1967 for molecules, until the
    pose has moved by more.
    """

    def __init__(self, target: Matrix, source: Gaussians, window_end: float) -> None:
        """Take the (k, 11) rows of the targets, see `kernels.reach`, and what may meet them."""
        self._target = target
        self._widths = source.widths
        self._window_end = window_end
        self._centre = source.means.mean(axis=0) if len(source) > 0 else np.zeros(3)
        arms = np.linalg.norm(source.means - self._centre, axis=1)
        arm = max(math.sqrt(float(arms @ arms) / max(1, len(arms))), 1e-9)
        widths = sum(float(one.sum()) / max(1, len(one)) for one in (target[:, 9], self._widths))
        self._shift = _SKIN * math.sqrt(window_end * widths)
        self._turn = self._shift / arm
        self._skins = read_only(self._shift + self._turn * arms)
        self._rows = read_only(np.arange(len(source)))
        self._kept: tuple[Pose, Lists] | None = None

    def at(self, pose: Pose, means: Points) -> Lists:
        """Return the lists of the last pose, or new ones where it is too far away."""
        # Read once and replaced as a whole, so that threads may share it.
        kept = self._kept
        if kept is None or not self._serves(kept[0], pose):
            starts, members = targets_in_reach(
                self._target,
                read_only(pose.apply(means)),
                self._widths,
                self._skins,
                self._window_end,
            )
            kept = pose, (self._rows, read_only(starts), read_only(members))
            self._kept = kept
        return kept[1]

    def _serves(self, old: Pose, new: Pose) -> bool:
        """Tell whether no source moved by more than its skin from one pose to the other."""
        change = new.rotation - old.rotation
        # Of a turn by a, a point on an arm r moves by 2 sin(a / 2) r, and the change of the
        # matrix has sqrt(2) times that factor as its norm.
        turn = math.sqrt(0.5 * float(np.vdot(change, change)))
        shift = change @ self._centre + (new.translation - old.translation)
        return turn <= self._turn and math.sqrt(float(shift @ shift)) <= self._shift


@dataclass(frozen=True, slots=True, eq=False)
class NearestTarget:
    """The one target whose mean is nearest (Stoyanov et al. 2012); it changes in jumps."""

    tree: PointTree
    """Of the target's means."""

    def at(self, pose: Pose, means: Points) -> Lists:
        """Return a list of one for every source."""
        rows, _ = self.tree.nearest(pose.apply(means))
        count = len(means)
        return (
            read_only(np.arange(count)),
            read_only(np.arange(count + 1)),
            read_only(self.tree.rows[rows]),
        )


@dataclass(frozen=True, slots=True, eq=False)
class CellsAround:
    """The targets at most so many cells away along each axis; they too change in jumps."""

    voxels: VoxelGaussians
    reach: int = field(default=2)
    """2 in the code that Stoyanov et al. published."""

    def __post_init__(self) -> None:
        require_count("reach", self.reach, 0)

    def at(self, pose: Pose, means: Points) -> Lists:
        """Return the cells around each source."""
        voxels, places = self.voxels, pose.apply(means)
        starts, members = rows_within(
            read_only(places), voxels.table, voxels.cells, voxels.corner, voxels.width, self.reach
        )
        return read_only(np.arange(len(places))), read_only(starts), read_only(members)
