"""Pairs of Gaussians that can score at a pose, and at all poses near it.

A pair is out of reach when its means are farther apart than the window allows for the largest
variances of either, which no rotation changes. Lists that reach a little farther stay good until
something has moved by as much (Verlet 1967), so most steps of a solver need no new ones, and the
value is that of all pairs.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from scanlock.arrays import read_only
from scanlock.geometry.pose import Pose
from scanlock.kernels.reach import targets_in_reach
from scanlock.models.gaussians import Gaussians
from scanlock.objectives.candidates import Lists

_SLACK = 0.1
"""How much farther the lists reach, as a share of the typical reach."""

_MOST_KEPT = 1 << 23
"""Members of lists that are kept; more are listed anew, a part at a time, for every value."""


@dataclass(frozen=True, slots=True, eq=False)
class NearPairs:
    """Lists of the targets in reach of every source, good around the pose they were made at.

    Attributes
    ----------
    lists : Lists
    pose : Pose
    slack : float [m]
        How far anything may have moved.
    radius : float [m]
        Largest distance of a source from zero of its frame.
    """

    lists: Lists
    pose: Pose
    slack: float
    radius: float

    def hold_at(self, pose: Pose) -> bool:
        """Tell whether nothing has moved too far."""
        # Twice the sine of half the angle between the two.
        turn = float(np.linalg.norm(pose.rotation - self.pose.rotation)) / math.sqrt(2.0)
        shift = float(np.linalg.norm(pose.translation - self.pose.translation))
        return shift + turn * self.radius <= self.slack


def near_pairs(
    target: Gaussians, source: Gaussians, pose: Pose, window_end: float
) -> Iterator[NearPairs]:
    """Yield the pairs in reach at a pose: all at once if they are not too many, else by parts.

    Parameters
    ----------
    target, source : Gaussians
    pose : Pose
    window_end : float
        Squared Mahalanobis distance from which a pair scores nothing.
    """
    if len(target) == 0 or len(source) == 0:
        return
    places = pose.apply(source.means)
    typical = float(np.median(target.widths) + np.median(source.widths))
    slack = _SLACK * math.sqrt(window_end * typical)
    # For any reach r, (sqrt(a) + slack)^2 <= a (1 + slack / r) + slack (slack + r).
    margin = slack * (slack + slack / _SLACK)
    radius = float(np.sqrt(np.einsum("ij,ij->i", source.means, source.means).max()))
    first = 0
    while first < len(source):
        starts, members = targets_in_reach(
            target.means,
            target.widths,
            read_only(places),
            source.widths,
            window_end * (1.0 + _SLACK),
            margin,
            first,
            _MOST_KEPT,
        )
        done = first + len(starts) - 1
        lists = np.full(len(source), -1, np.int64)
        lists[first:done] = np.arange(done - first)
        is_all = first == 0 and done == len(source)
        first = done
        yield NearPairs(
            (read_only(lists), read_only(starts), read_only(members)),
            pose,
            slack if is_all else -math.inf,
            radius,
        )
