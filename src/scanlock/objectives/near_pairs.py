"""Pairs of Gaussians that can score at a pose, and at all poses near it.

A pair is out of reach when its means are farther apart than the window allows for the largest
variances of either, which no rotation changes. Lists that reach a little farther stay good until
something has moved by as much (Verlet 1967), so most steps of a solver need no new ones, and the
value is that of all pairs.
"""

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from scanlock.arrays import Labels, Matrix, Vector, read_only
from scanlock.geometry.pose import Pose
from scanlock.kernels.reach import sorted_by_cell, targets_in_reach
from scanlock.models.gaussians import Gaussians
from scanlock.objectives.candidates import Lists

_SLACK = 0.1
"""How much farther the lists reach, as a share of the typical reach."""

_PART = 1024
"""Sources whose pairs are one piece of work, whatever the number of threads."""

_MOST_KEPT = 1 << 23
"""Pairs whose lists are kept; more are listed anew, a part at a time, for every value."""

_MOST_CELLS = 128
"""Cells along a side of the grid that the targets are sorted into."""

_LEAST_CELL = 1e-3
"""Least side of a cell [m]: targets may all lie in one place."""

_Grid = tuple[Labels, Labels, Matrix, Vector, float, int, int, float]


@dataclass(frozen=True, eq=False)
class NearPairs:
    """Lists of the targets in reach of every source, good around the pose they are made at.

    Attributes
    ----------
    target, source : Gaussians
    pose : Pose
    window_end : float
        Squared Mahalanobis distance from which a pair scores nothing.
    """

    target: Gaussians
    source: Gaussians
    pose: Pose
    window_end: float
    _kept: dict[int, Lists] = field(default_factory=dict[int, Lists])

    @property
    def parts(self) -> range:
        """The pieces that the sources are cut into."""
        return range(math.ceil(len(self.source) / _PART) if len(self.target) else 0)

    def rows(self, part: int) -> slice:
        """Return the sources of a part."""
        return slice(part * _PART, min((part + 1) * _PART, len(self.source)))

    def lists(self, part: int) -> Lists:
        """Return the lists of the sources of a part."""
        kept = self._kept.get(part)
        if kept is None:
            kept = self._listed(part)
            if sum(len(members) for _, _, members in self._kept.values()) < _MOST_KEPT:
                self._kept[part] = kept
        return kept

    def hold_at(self, pose: Pose) -> bool:
        """Tell whether nothing has moved farther than the lists allow."""
        # Twice the sine of half the angle between the two.
        turn = float(np.linalg.norm(pose.rotation - self.pose.rotation)) / math.sqrt(2.0)
        shift = float(np.linalg.norm(pose.translation - self.pose.translation))
        return shift + turn * self._radius <= self.slack

    @cached_property
    def slack(self) -> float:
        """How far anything may have moved [m]."""
        typical = float(np.median(self.target.widths) + np.median(self.source.widths))
        return _SLACK * math.sqrt(self.window_end * typical)

    @cached_property
    def _radius(self) -> float:
        """Largest distance of a source from zero of its frame [m]."""
        means = self.source.means
        return float(np.sqrt(np.einsum("ij,ij->i", means, means).max()))

    @cached_property
    def _margin(self) -> float:
        # For any reach r, (sqrt(a) + slack)^2 <= a (1 + slack / r) + slack (slack + r).
        return self.slack * (self.slack + self.slack / _SLACK)

    @cached_property
    def _grid(self) -> _Grid:
        target = self.target
        low, high = target.means[:, :2].min(axis=0), target.means[:, :2].max(axis=0)
        widest = float(target.widths.max())
        reach = math.sqrt(
            self.window_end * (1.0 + _SLACK) * (widest + float(self.source.widths.max()))
            + self._margin
        )
        # Half the reach: of what is looked at, half is in reach.
        width = max(0.5 * reach, float((high - low).max()) / _MOST_CELLS, _LEAST_CELL)
        columns, rows = (int(count) + 1 for count in (high - low) / width)
        corner = read_only(low)
        found = sorted_by_cell(target.means, target.widths, corner, width, columns, rows)
        starts, order, inside = found
        grid = read_only(starts), read_only(order), read_only(inside)
        return *grid, corner, width, columns, rows, widest

    def _listed(self, part: int) -> Lists:
        rows = self.rows(part)
        ends, members = targets_in_reach(
            *self._grid,
            read_only(self.pose.apply(self.source.means[rows])),
            read_only(self.source.widths[rows]),
            self.window_end * (1.0 + _SLACK),
            self._margin,
        )
        return read_only(np.arange(len(ends) - 1)), read_only(ends), read_only(members)
