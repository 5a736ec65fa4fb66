"""ICP with recurring poses: thresholds that grow and shrink, correspondences that alternate."""

import itertools
import math
from dataclasses import dataclass

import numpy as np

from reference import point_tree
from reference.point_scans import point_scan
from scanlock.geometry.pose import Pose
from scanlock.optimisation.solvers.criteria import StopReason
from scanlock.registration.methods.icp.distance_rejection import FixedRejection
from scanlock.registration.methods.icp.icp import Icp

_LATTICE = 10.0 * np.array(list(itertools.product(range(4), repeat=3)), np.float64) - 15.0
"""Points too far apart for another point to become the nearest."""


@dataclass
class _AlternatingRejection:
    """A threshold that is wide for small distances and narrow for large ones."""

    max_distance: float = math.inf

    def threshold(self, distances, previous, spacing):
        return 2.0 if distances.mean() < 0.3 else 0.5

    def note(self, spacing):
        return ""


def test_alternating_thresholds_are_bounded_by_their_minimum():
    source = _LATTICE.copy()
    source[::4, 0] += 1.0  # a quarter of the points, which only the wide threshold keeps
    method = Icp(voxel_size=None, rejection=_AlternatingRejection())
    solution = method.align(point_scan(_LATTICE), point_scan(source), Pose.identity())
    assert solution.reason is StopReason.STEP_SMALL
    assert len(solution.history) < 20
    assert "poses recurred: distance threshold at most 0.5 m" in map(str, solution.notes)
    assert solution.history[-1].pairs == 48
    # The points that did not move fit exactly, and the bounded threshold keeps only these.
    assert solution.pose.is_close(Pose.identity(), translation=1e-6, rotation=1e-7)


@dataclass
class _AlternatingSearch:
    """A search that returns points of the first and of the second half in turn."""

    points: np.ndarray
    calls: int = 0

    def nearest(self, queries, max_distance=np.inf):
        rows, distances = point_tree.nearest(self.points[: len(queries)], queries)
        self.calls += 1
        return rows + len(queries) * (self.calls % 2), distances


def test_alternating_correspondences_end_the_iteration():
    # Two copies of the lattice, 0.2 m apart, of which each in turn is found.
    both = np.concatenate([_LATTICE, _LATTICE + np.array([0.2, 0.0, 0.0])])
    target = point_scan(both, closest=_AlternatingSearch(both))
    method = Icp(rejection=FixedRejection())
    solution = method.align(target, point_scan(_LATTICE), Pose.identity())
    assert solution.reason is StopReason.STEP_SMALL
    assert len(solution.history) < 20
    assert "poses recurred: distance threshold at most 1 m" in map(str, solution.notes)
    positions = [one.pose.translation[0] for one in solution.history]
    np.testing.assert_allclose(np.sort(np.unique(np.round(positions, 9))), [0.0, 0.2])


def test_alternating_correspondences_end_the_iteration_without_a_threshold():
    both = np.concatenate([_LATTICE, _LATTICE + np.array([0.2, 0.0, 0.0])])
    target = point_scan(both, closest=_AlternatingSearch(both))
    method = Icp(rejection=None, max_correspondence_distance=math.inf)
    solution = method.align(target, point_scan(_LATTICE), Pose.identity())
    assert solution.reason is StopReason.STEP_SMALL
    assert len(solution.history) < 20
