import numpy as np
import pytest

from reference import gaussian_scores as reference
from reference.samples import gaussians
from scanlock.clouds.point_tree import PointTree
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.models.voxel_gaussians import VoxelGrid
from scanlock.objectives.candidates import CellsAround, EveryTarget, NearestTarget
from scanlock.objectives.gaussian_scores import GaussiansToGaussians, ScoreShape


def _members(lists, source):
    rows, starts, members = lists
    if rows[source] < 0:
        return set()
    return set(members[starts[rows[source]] : starts[rows[source] + 1]].tolist())


def _rule(target, source):
    return GaussiansToGaussians(target=target, source=source)._candidates


def _assert_same(found, expected):
    np.testing.assert_allclose(found.value, expected.value, rtol=1e-12)
    scale = np.abs(expected.hessian).max()
    np.testing.assert_allclose(found.gradient, expected.gradient, rtol=0.0, atol=1e-12 * scale)
    np.testing.assert_allclose(found.hessian, expected.hessian, rtol=0.0, atol=1e-12 * scale)


@pytest.mark.parametrize("spread", [5.0, 40.0, 2000.0])
@pytest.mark.parametrize("seed", range(3))
def test_targets_in_reach_score_as_all_of_them_do(seed, spread):
    rng = np.random.default_rng(seed)
    target, source = (gaussians(rng, 90, spread=spread, least=0.2, most=4.0) for _ in range(2))
    pose = Pose.from_step(rng.normal(0.0, [5.0, 5.0, 1.0, 1.0, 1.0, 2.0]))
    shape = ScoreShape(sharpness=0.5)
    both = {"target": target, "source": source, "shape": shape}
    every = GaussiansToGaussians(**both, candidates=EveryTarget()).linearise(pose)
    listed = GaussiansToGaussians(**both).linearise(pose)
    expected = reference.d2d_value(pose, target, source, sharpness=0.5)
    np.testing.assert_allclose(every.value, expected, rtol=1e-12, atol=1e-300)
    # The pairs left out count nothing; the others come in another order.
    _assert_same(listed, every)


def test_targets_in_reach_leave_most_of_a_wide_scene_out():
    rng = np.random.default_rng(4)
    target, source = (gaussians(rng, 400, spread=60.0, most=0.8) for _ in range(2))
    _, starts, members = _rule(target, source).at(Pose.identity(), source.means)
    assert starts[-1] == len(members)
    assert 0 < len(members) < 0.1 * 400 * 400


def test_lists_are_kept_for_small_motions_and_made_anew_for_large_ones():
    rng = np.random.default_rng(5)
    target, source = (gaussians(rng, 60, spread=20.0) for _ in range(2))
    rule = _rule(target, source)
    first = rule.at(Pose.identity(), source.means)
    small = Pose.from_step(np.array([1e-3, 0.0, 0.0, 0.0, 0.0, 1e-4]))
    assert rule.at(small, source.means) is first
    for step in ([50.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 0.0, 1.0]):
        assert rule.at(Pose.from_step(np.array(step)), source.means) is not first
        first = rule.at(Pose.identity(), source.means)


@pytest.mark.parametrize("seed", range(4))
def test_a_walk_over_kept_lists_scores_as_all_pairs_do_at_every_step(seed):
    # Off their origin, so that turns move the sources as a whole as well.
    rng = np.random.default_rng(seed)
    target, source = (gaussians(rng, 60, spread=8.0, least=0.2, most=1.0) for _ in range(2))
    source = source.transformed(Pose(np.eye(3), np.array([30.0, 0.0, 0.0])))
    pose = Pose(np.eye(3), np.array([-30.0, 0.0, 0.0]))
    both = {"target": target, "source": source}
    listed = GaussiansToGaussians(**both)
    every = GaussiansToGaussians(**both, candidates=EveryTarget())
    kept = set()
    for _ in range(30):
        pose = pose @ Pose.from_step(rng.normal(0.0, [0.05] * 3 + [0.001] * 3))
        _assert_same(listed.linearise(pose), every.linearise(pose))
        kept.add(id(listed._candidates.at(pose, source.means)))
    assert len(kept) < 30


def test_nothing_is_in_reach_of_no_gaussians():
    some, none = gaussians(np.random.default_rng(6), 5), gaussians(np.random.default_rng(6), 0)
    for target, source in ((some, none), (none, some), (none, none)):
        at = GaussiansToGaussians(target=target, source=source).linearise(Pose.identity())
        assert at.value == 0.0
        np.testing.assert_array_equal(at.hessian, 0.0)


def test_the_value_alone_is_that_of_the_quadratic():
    rng = np.random.default_rng(9)
    both = GaussiansToGaussians(target=gaussians(rng, 30), source=gaussians(rng, 40))
    assert both.value(Pose.identity()) == both.linearise(Pose.identity()).value < 0.0


def test_the_nearest_target_is_the_one_of_least_distance_between_means():
    rng = np.random.default_rng(7)
    target = gaussians(rng, 50)
    places = rng.uniform(-12.0, 12.0, (80, 3))
    lists = NearestTarget(PointTree.from_points(target.means)).at(Pose.identity(), places)
    gaps = np.linalg.norm(places[:, None] - target.means, axis=2)
    for source, nearest in enumerate(gaps.argmin(axis=1).tolist()):
        assert _members(lists, source) == {nearest}


@pytest.mark.parametrize("reach", [0, 1, 2])
def test_cells_around_are_those_within_reach_along_each_axis(reach):
    rng = np.random.default_rng(8)
    voxels = VoxelGrid(offset=0.4).gaussians(rng.normal(0.0, 2.0, (2000, 3)), 1.0)
    places = rng.normal(0.0, 3.0, (60, 3))
    lists = CellsAround(voxels, reach).at(Pose.identity(), places)
    cells = np.floor(places - 0.4)
    steps = np.abs(cells[:, None] - voxels.cells).max(axis=2)
    found = [_members(lists, i) for i in range(60)]
    assert found == [set(np.flatnonzero(row <= reach).tolist()) for row in steps]
    assert any(found)


def test_a_reach_below_zero_is_refused():
    voxels = VoxelGrid().gaussians(np.zeros((10, 3)), 1.0)
    with pytest.raises(InvalidInput, match="reach must be a whole number of at least 0, got -1"):
        CellsAround(voxels, -1)
