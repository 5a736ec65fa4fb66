"""Neighbour lists: the pairs of Gaussians that can score at a pose and at all poses near it.

A pair is out of range when the distance of its means exceeds the end of the window for the
largest variances of either Gaussian, which no rotation changes. Lists with a margin stay valid
until a source has moved by the margin (Verlet 1967). Most steps of a solver therefore need no new
lists, and the value is still that of all pairs.
"""

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from scanlock.arrays import Labels, Matrix, Vector, read_only
from scanlock.geometry.pose import Pose
from scanlock.kernels.gaussians.neighbour_lists import (
    centroid_and_distances,
    neighbour_lists,
    sorted_by_cell,
)
from scanlock.models.gaussians import Gaussians
from scanlock.optimisation.objectives.associations import Lists

_SLACK = 0.03
"""Maximum translation of the centre while lists are valid, over the typical cut-off distance."""

_CHUNK = 1024
"""Sources in one piece of work, for any number of threads."""

_MAX_CACHED = 1 << 23
"""Maximum number of pairs in cached lists; the lists of further chunks are computed at each use."""

_CELL = 0.8
"""Side of the cells that the targets are sorted into, over the typical cut-off distance."""

_MIN_CELL = 1e-3
"""Minimum side of a cell [m], for targets that all lie in one place."""

_MIN_ARM = 1e-3
"""Minimum typical distance of the sources from their centre [m], for a single source."""

_Grid = tuple[Labels, Labels, Matrix, Vector, float, int, int, float]


@dataclass(frozen=True, eq=False)
class NeighbourSearch:
    """Cut-off distances and cell grid of a pair of Gaussian sets, for any pose.

    Attributes
    ----------
    target, source : Gaussians
    window_end : float
        Squared Mahalanobis distance from which a pair scores 0.
    """

    target: Gaussians
    source: Gaussians
    window_end: float

    @property
    def scale(self) -> float:
        """Factor of the sum of both variances in the squared cut-off distance."""
        return self.window_end * (1.0 + _SLACK)

    @cached_property
    def centre(self) -> Vector:
        """Mean of the sources in their own frame (3,) [m]."""
        return self._centre_and_arms[0]

    @cached_property
    def max_shift(self) -> float:
        """Maximum translation of the centre while lists are valid [m]."""
        both = _quantile(self.target.max_variances, 0.5) + _quantile(self.source.max_variances, 0.5)
        return _SLACK * math.sqrt(self.window_end * both)

    @cached_property
    def max_turn(self) -> float:
        """Maximum rotation about the centre while lists are valid [rad].

        It moves a source at the typical distance by `max_shift`.
        """
        arms = self._arms
        typical = max(math.sqrt(float(arms @ arms) / max(1, len(arms))), _MIN_ARM)
        return self.max_shift / typical

    @cached_property
    def margins(self) -> Vector:
        """Margin of each source in the squared cut-off distance (m,) [m^2]."""
        slacks = self.max_shift + self.max_turn * self._arms
        # For any e > 0, (sqrt(a) + slack)^2 <= (1 + e) a + (1 + 1 / e) slack^2.
        return read_only((1.0 + 1.0 / _SLACK) * slacks**2)

    @cached_property
    def _arms(self) -> Vector:
        return self._centre_and_arms[1]

    @cached_property
    def _centre_and_arms(self) -> tuple[Vector, Vector]:
        return centroid_and_distances(self.source.means)

    @cached_property
    def grid(self) -> _Grid:
        """At least one target, sorted into cells below the typical cut-off distance."""
        target = self.target
        side = max(_CELL * self.max_shift / _SLACK, _MIN_CELL)
        starts, order, inside, corner, side, columns, rows = sorted_by_cell(
            target.means, target.max_variances, side
        )
        cells = read_only(starts), read_only(order), read_only(inside)
        return *cells, read_only(corner), side, columns, rows, float(target.max_variances.max())


@dataclass(frozen=True, eq=False)
class NeighbourLists:
    """Lists of the targets in range of each source, valid around the pose they are computed at.

    Attributes
    ----------
    search : NeighbourSearch
    pose : Pose
    """

    search: NeighbourSearch
    pose: Pose
    _cached: dict[int, Lists] = field(default_factory=dict[int, Lists])

    @property
    def chunks(self) -> range:
        """Chunks that the sources are divided into."""
        search = self.search
        return range(math.ceil(len(search.source) / _CHUNK) if len(search.target) else 0)

    def rows(self, chunk: int) -> slice:
        """Return the sources of a chunk."""
        return slice(chunk * _CHUNK, min((chunk + 1) * _CHUNK, len(self.search.source)))

    def lists(self, chunk: int) -> Lists:
        """Return the lists of the sources of a chunk."""
        lists = self._cached.get(chunk)
        if lists is None:
            lists = self.computed(self.rows(chunk))
            # An atomic copy: other threads may be adding lists.
            if sum(len(members) for _, _, members in list(self._cached.values())) < _MAX_CACHED:
                self._cached[chunk] = lists
        return lists

    def all_lists(self) -> Lists:
        """Return the lists of all sources."""
        parts = [self.lists(chunk) for chunk in self.chunks]
        if not parts:
            return self.computed(slice(0, len(self.search.source)))
        if len(parts) == 1:
            return parts[0]
        lists, starts, count, length = [], [np.zeros(1, np.int64)], 0, 0
        for of_part, part_starts, members in parts:
            lists.append(of_part + count)
            starts.append(part_starts[1:] + length)
            count, length = count + len(part_starts) - 1, length + len(members)
        joined = (lists, starts, [members for _, _, members in parts])
        of_all, of_starts, of_members = (read_only(np.concatenate(one)) for one in joined)
        return of_all, of_starts, of_members

    def are_valid_at(self, pose: Pose) -> bool:
        """Return whether no source has moved by more than its margin."""
        change = pose.rotation - self.pose.rotation
        # A turn by a moves the end of an arm r by 2 sin(a / 2) r, and sqrt(2) times that factor
        # is the norm of the change.
        turn = math.sqrt(0.5 * float(np.vdot(change, change)))
        shift = change @ self.search.centre + pose.translation - self.pose.translation
        is_near = math.sqrt(float(shift @ shift)) <= self.search.max_shift
        return turn <= self.search.max_turn and is_near

    def computed(self, rows: slice) -> Lists:
        """Return new lists of some sources."""
        search = self.search
        if not len(search.target):
            none = np.zeros(0, np.int64)
            lists = np.full(rows.stop - rows.start, -1, np.int64)
            return read_only(lists), read_only(np.zeros(1, np.int64)), read_only(none)
        ends, members = neighbour_lists(
            *search.grid,
            read_only(search.source.means[rows]),
            read_only(search.source.max_variances[rows]),
            read_only(search.margins[rows]),
            self.pose.rotation,
            self.pose.translation,
            search.scale,
        )
        return read_only(np.arange(len(ends) - 1)), read_only(ends), read_only(members)


def _quantile(values: Vector, fraction: float) -> float:
    """Return the smallest value that is not below a fraction of all values; 0 of no values."""
    if len(values) == 0:
        return 0.0
    # NumPy's own takes longer than all the rest of a small grid.
    position = math.ceil(fraction * (len(values) - 1))
    return float(np.partition(values, position)[position])
