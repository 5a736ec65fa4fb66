import numpy as np
import pytest

from reference.samples import gaussians, yaw_pose
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.models.cluster_features import ClusterFeatures
from scanlock.models.gaussians import Gaussians
from scanlock.registration.compatibility import Matches, Tolerances, agreement_graphs

_TOLERANCES = Tolerances(distance=0.4, slope=0.1, angle=0.15, least_distance=2.0, slack=0.15)
_GRADES = (1.0, 4.0)


def _neighbours(graph):
    """The words as truth values, one for each two rows."""
    octets = np.ascontiguousarray(graph).astype("<u8").view(np.uint8)
    return np.unpackbits(octets, axis=-1, bitorder="little")[..., : graph.shape[-2]].astype(bool)


def test_mutual_matches_are_near_on_both_sides():
    rng = np.random.default_rng(4)
    unlikeness = rng.uniform(0.0, 12.0, (12, 9))
    unlikeness[3] = np.inf
    matches = Matches.mutual(unlikeness, 3)
    expected = {
        (column, row)
        for row, column in np.ndindex(12, 9)
        if unlikeness[row, column] <= 9.0
        and (unlikeness[row] < unlikeness[row, column]).sum() < 3
        and (unlikeness[:, column] < unlikeness[row, column]).sum() < 3
    }
    assert len(matches) == len(expected) > 9
    assert set(zip(matches.target.tolist(), matches.source.tolist(), strict=True)) == expected


def test_more_nearest_than_parts_match_all_that_are_alike():
    unlikeness = np.array([[1.0, 10.0, 3.0], [9.0, np.inf, 2.0]])
    matches = Matches.mutual(unlikeness, 50)
    assert matches.source.tolist() == [0, 0, 1, 1]
    assert matches.target.tolist() == [0, 2, 0, 2]


def test_the_least_are_kept_and_the_first_of_equals():
    matches = Matches(np.array([5, 6, 7, 8]), np.array([0, 1, 2, 3]))
    values = np.array([2.0, 1.0, 2.0, 3.0])
    assert matches.least(values, 2).target.tolist() == [6, 5]
    assert matches.least(values, 4) is matches
    assert len(matches.least(values, 0)) == 0


def _pair(pose, level):
    """Features of a world and of the same seen from elsewhere, and matches half of them right."""
    world = gaussians(np.random.default_rng(2), 40, spread=15.0, most=1.0)
    moved = Gaussians(world.means, world.covariances, world.counts).transformed(pose.inverse())
    rows = np.arange(40)
    source = np.where(rows < 20, rows, (rows + 7) % 20)
    return (
        ClusterFeatures.of(world, level),
        ClusterFeatures.of(moved, level),
        Matches(rows, source),
    )


@pytest.mark.parametrize("is_level", [True, False])
def test_right_matches_agree_and_grades_are_nested(is_level):
    turn = np.array([0.0, 0.0, 1.0]) if is_level else np.array([1.0, -0.6, 2.0])
    pose = Pose(exp_rotation(turn), np.array([4.0, -3.0, 0.2]))
    level = Pose.identity() if is_level else None
    target, source, matches = _pair(pose, level)
    graphs = _neighbours(
        agreement_graphs(target, source, matches, _TOLERANCES, _GRADES, is_level=is_level)
    )
    far = np.hypot(*np.moveaxis(target.centres[:, None, :2] - target.centres[:, :2], -1, 0)) > 2.0
    right = np.ix_(np.arange(20), np.arange(20))
    assert graphs[0][right][far[right]].all()
    wrong = graphs[0][20:]
    assert wrong.mean() < 0.2
    assert (graphs[0] <= graphs[1]).all()
    assert (graphs[0] < graphs[1]).any()


def test_heights_are_compared_only_where_both_are_level():
    pose = Pose(exp_rotation(np.array([1.2, 0.0, 0.0])), np.zeros(3))
    target, source, matches = _pair(pose, Pose.identity())
    level, free = (
        _neighbours(
            agreement_graphs(target, source, matches, _TOLERANCES, _GRADES, is_level=is_level)
        )[0][:20, :20].mean()
        for is_level in (True, False)
    )
    assert level < 0.5 * free


def test_no_matches_make_an_empty_graph():
    target, source, _ = _pair(yaw_pose(1.0, (0.0, 0.0, 0.0)), None)
    none = Matches(np.empty(0, np.int64), np.empty(0, np.int64))
    graphs = agreement_graphs(target, source, none, _TOLERANCES, _GRADES, is_level=False)
    assert graphs.shape == (2, 0, 0)
