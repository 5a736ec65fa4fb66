"""ICP where poses come back: limits that grow and shrink in turn, pairs that change sides."""

import itertools
import math
from dataclasses import dataclass

import numpy as np

from reference import point_tree
from reference.point_scans import point_scan
from scanlock.geometry.pose import Pose
from scanlock.optimisation.solvers.criteria import StopReason
from scanlock.registration.methods.correspondences import CorrespondenceFinder
from scanlock.registration.methods.icp import Icp
from scanlock.registration.methods.rejection import FixedRejection

_LATTICE = 10.0 * np.array(list(itertools.product(range(4), repeat=3)), np.float64) - 15.0
"""Points too far apart for a pair to change sides."""


@dataclass
class _Seesaw:
    """A gate that widens where the pairs are near and narrows where they are far."""

    reach: float = math.inf

    def limit(self, distances, previous, spacing):
        return 2.0 if distances.mean() < 0.3 else 0.5

    def note(self, spacing):
        return ""


def test_limits_that_grow_and_shrink_for_ever_are_held_at_their_least():
    source = _LATTICE.copy()
    source[::4, 0] += 1.0  # a quarter of the points, which the wide limit lets in
    method = Icp(voxel_size=None, correspondences=CorrespondenceFinder(rejection=_Seesaw()))
    solution = method.align(point_scan(_LATTICE), point_scan(source), Pose.identity())
    assert solution.reason is StopReason.STEP_SMALL
    assert len(solution.history) < 20
    assert "the same pairs came back: limit held at 0.5 m" in solution.notes
    assert solution.history[-1].pairs == 48
    # The points that did not move fit exactly: the held limit is descended to its end.
    assert solution.pose.is_close(Pose.identity(), translation=1e-6, rotation=1e-7)


@dataclass
class _Turncoat:
    """A search that answers with one set of partners and the other in turn."""

    points: np.ndarray
    calls: int = 0

    def nearest(self, queries, limit=np.inf):
        rows, distances = point_tree.nearest(self.points[: len(queries)], queries)
        self.calls += 1
        return rows + len(queries) * (self.calls % 2), distances


def test_pairs_that_change_sides_for_ever_end_it():
    # Two copies of the lattice, 0.2 m apart, and each in turn for the closest.
    both = np.concatenate([_LATTICE, _LATTICE + np.array([0.2, 0.0, 0.0])])
    target = point_scan(both, closest=_Turncoat(both))
    method = Icp(correspondences=CorrespondenceFinder(rejection=FixedRejection()))
    solution = method.align(target, point_scan(_LATTICE), Pose.identity())
    assert solution.reason is StopReason.STEP_SMALL
    assert len(solution.history) < 20
    assert "the same pairs came back: limit held at 1 m" in solution.notes
    ends = [one.pose.translation[0] for one in solution.history]
    np.testing.assert_allclose(np.sort(np.unique(np.round(ends, 9))), [0.0, 0.2])
