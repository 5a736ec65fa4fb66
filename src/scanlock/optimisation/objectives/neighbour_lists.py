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
from scanlock.kernels.gaussians.neighbour_lists import (
    centre_and_arms,
    sorted_by_cell,
    targets_in_reach,
)
from scanlock.models.gaussians import Gaussians
from scanlock.optimisation.objectives.candidates import Lists

_SLACK = 0.03
"""How far the centre may move while lists last, as a share of the typical reach."""

_PART = 1024
"""Sources whose pairs are one piece of work, whatever the number of threads."""

_MOST_KEPT = 1 << 23
"""Pairs whose lists are kept; more are listed anew, a part at a time, for every value."""

_CELL = 0.8
"""Side of the cells that the targets are sorted into, as a share of the typical reach."""

_LEAST_CELL = 1e-3
"""Least side of a cell [m]: targets may all lie in one place."""

_LEAST_ARM = 1e-3
"""Least typical distance of the sources from their centre [m]: there may be only one."""

_Grid = tuple[Labels, Labels, Matrix, Vector, float, int, int, float]


@dataclass(frozen=True, eq=False)
class Reach:
    """How far each source reaches, whatever the pose.

    Attributes
    ----------
    target, source : Gaussians
    window_end : float
        Squared Mahalanobis distance from which a pair scores nothing.
    """

    target: Gaussians
    source: Gaussians
    window_end: float

    @property
    def scale(self) -> float:
        """A pair is in reach at a squared distance below this by both widths, and the margin."""
        return self.window_end * (1.0 + _SLACK)

    @cached_property
    def centre(self) -> Vector:
        """Mean of the sources in their own frame (3,) [m]."""
        return self._centre_and_arms[0]

    @cached_property
    def shift(self) -> float:
        """How far the centre may move before lists must be made anew [m]."""
        both = _quantile(self.target.max_variances, 0.5) + _quantile(self.source.max_variances, 0.5)
        return _SLACK * math.sqrt(self.window_end * both)

    @cached_property
    def turn(self) -> float:
        """How far all may turn about it [rad]: the typical source then moves by the shift again."""
        arms = self._arms
        return self.shift / max(math.sqrt(float(arms @ arms) / max(1, len(arms))), _LEAST_ARM)

    @cached_property
    def margins(self) -> Vector:
        """What the slack of each source adds to the squared distances in reach (m,) [m^2]."""
        slacks = self.shift + self.turn * self._arms
        # For any share e, (sqrt(a) + slack)^2 <= (1 + e) a + (1 + 1 / e) slack^2.
        return read_only((1.0 + 1.0 / _SLACK) * slacks**2)

    @cached_property
    def _arms(self) -> Vector:
        return self._centre_and_arms[1]

    @cached_property
    def _centre_and_arms(self) -> tuple[Vector, Vector]:
        return centre_and_arms(self.source.means)

    @cached_property
    def grid(self) -> _Grid:
        """The targets, sorted into cells somewhat smaller than the typical reach."""
        target = self.target
        side = max(_CELL * self.shift / _SLACK, _LEAST_CELL)
        starts, order, inside, corner, side, columns, rows = sorted_by_cell(
            target.means, target.max_variances, side
        )
        cells = read_only(starts), read_only(order), read_only(inside)
        return *cells, read_only(corner), side, columns, rows, float(target.max_variances.max())


@dataclass(frozen=True, eq=False)
class NeighbourLists:
    """Lists of the targets in reach of every source, good around the pose they are made at.

    Attributes
    ----------
    reach : Reach
    pose : Pose
    """

    reach: Reach
    pose: Pose
    _kept: dict[int, Lists] = field(default_factory=dict[int, Lists])

    @property
    def parts(self) -> range:
        """The pieces that the sources are cut into."""
        reach = self.reach
        return range(math.ceil(len(reach.source) / _PART) if len(reach.target) else 0)

    def rows(self, part: int) -> slice:
        """Return the sources of a part."""
        return slice(part * _PART, min((part + 1) * _PART, len(self.reach.source)))

    def lists(self, part: int) -> Lists:
        """Return the lists of the sources of a part."""
        kept = self._kept.get(part)
        if kept is None:
            kept = self.listed(self.rows(part))
            # A copy at one stroke: other threads may be adding theirs.
            if sum(len(members) for _, _, members in list(self._kept.values())) < _MOST_KEPT:
                self._kept[part] = kept
        return kept

    def hold_at(self, pose: Pose) -> bool:
        """Tell whether no source has moved farther than the lists allow."""
        change = pose.rotation - self.pose.rotation
        # A turn by a moves the end of an arm r by 2 sin(a / 2) r, and sqrt(2) times that factor
        # is the norm of the change.
        turn = math.sqrt(0.5 * float(np.vdot(change, change)))
        shift = change @ self.reach.centre + pose.translation - self.pose.translation
        return turn <= self.reach.turn and math.sqrt(float(shift @ shift)) <= self.reach.shift

    def listed(self, rows: slice) -> Lists:
        """Return the lists of some sources, made anew."""
        reach = self.reach
        ends, members = targets_in_reach(
            *reach.grid,
            read_only(reach.source.means[rows]),
            read_only(reach.source.max_variances[rows]),
            read_only(reach.margins[rows]),
            self.pose.rotation,
            self.pose.translation,
            reach.scale,
        )
        return read_only(np.arange(len(ends) - 1)), read_only(ends), read_only(members)


def _quantile(values: Vector, share: float) -> float:
    """Return the least value that is no less than a share of all; 0 where there are none."""
    if len(values) == 0:
        return 0.0
    # NumPy's own takes longer than all the rest of a small grid.
    place = math.ceil(share * (len(values) - 1))
    return float(np.partition(values, place)[place])
