import numpy as np
import pytest

from reference import gaussian_scores as reference
from reference.samples import gaussians
from scanlock.clouds.point_tree import PointTree
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.models.voxel_gaussians import VoxelGrid
from scanlock.objectives.candidates import CellsAround, EveryTarget, NearestTarget, TargetsInReach
from scanlock.objectives.gaussian_scores import GaussiansToGaussians, ScoreShape


def _members(lists, source):
    rows, starts, members = lists
    if rows[source] < 0:
        return set()
    return set(members[starts[rows[source]] : starts[rows[source] + 1]].tolist())


@pytest.mark.parametrize("spread", [5.0, 40.0, 2000.0])
@pytest.mark.parametrize("seed", range(3))
def test_targets_in_reach_score_as_all_of_them_do(seed, spread):
    rng = np.random.default_rng(seed)
    target, source = (gaussians(rng, 90, spread=spread, least=0.2, most=4.0) for _ in range(2))
    pose = Pose.from_step(rng.normal(0.0, [5.0, 5.0, 1.0, 1.0, 1.0, 2.0]))
    shape = ScoreShape(sharpness=0.5)
    rule = TargetsInReach.of(target, source, shape.parameters[2])
    both = {"target": target, "source": source, "shape": shape}
    every = GaussiansToGaussians(**both, candidates=EveryTarget()).linearise(pose)
    listed = GaussiansToGaussians(**both, candidates=rule).linearise(pose)
    expected = reference.d2d_value(pose, target, source, sharpness=0.5)
    np.testing.assert_allclose(every.value, expected, rtol=1e-12, atol=1e-300)
    # The pairs left out count nothing, and the others come in the same order.
    assert listed.value == every.value
    np.testing.assert_array_equal(listed.hessian, every.hessian)


def test_targets_in_reach_leave_most_of_a_wide_scene_out():
    rng = np.random.default_rng(4)
    target, source = (gaussians(rng, 400, spread=60.0, most=0.8) for _ in range(2))
    rule = TargetsInReach.of(target, source, 25.0)
    lists = rule.at(source.means)
    listed = np.array([len(_members(lists, i)) for i in range(400)])
    assert 0 < listed.mean() < 0.1 * len(target)


def test_places_outside_all_tiles_have_no_list():
    rng = np.random.default_rng(5)
    target = gaussians(rng, 10, spread=5.0)
    rule = TargetsInReach.of(target, target, 25.0)
    rows, _, _ = rule.at(np.array([[1e4, 0.0, 0.0], [0.0, -1e12, 0.0], [0.0, 0.0, 0.0]]))
    assert (rows[:2] == -1).all()
    assert rows[2] >= 0


def test_many_pairs_are_listed_by_themselves_and_score_the_same():
    rng = np.random.default_rng(6)
    target, source = (gaussians(rng, 520, spread=30.0, most=0.8) for _ in range(2))
    pose = Pose.from_step(0.1 * rng.normal(size=6))
    both = {"target": target, "source": source}
    found = GaussiansToGaussians(**both).linearise(pose)
    every = GaussiansToGaussians(**both, candidates=EveryTarget()).linearise(pose)
    assert found.value == every.value < 0.0
    np.testing.assert_array_equal(found.hessian, every.hessian)


def test_the_nearest_target_is_the_one_of_least_distance_between_means():
    rng = np.random.default_rng(7)
    target = gaussians(rng, 50)
    places = rng.uniform(-12.0, 12.0, (80, 3))
    lists = NearestTarget(PointTree.from_points(target.means)).at(places)
    gaps = np.linalg.norm(places[:, None] - target.means, axis=2)
    for source, nearest in enumerate(gaps.argmin(axis=1).tolist()):
        assert _members(lists, source) == {nearest}


@pytest.mark.parametrize("reach", [0, 1, 2])
def test_cells_around_are_those_within_reach_along_each_axis(reach):
    rng = np.random.default_rng(8)
    voxels = VoxelGrid(offset=0.4).gaussians(rng.normal(0.0, 2.0, (2000, 3)), 1.0)
    places = rng.normal(0.0, 3.0, (60, 3))
    lists = CellsAround(voxels, reach).at(places)
    cells = np.floor(places - 0.4)
    steps = np.abs(cells[:, None] - voxels.cells).max(axis=2)
    found = [_members(lists, i) for i in range(60)]
    assert found == [set(np.flatnonzero(row <= reach).tolist()) for row in steps]
    assert any(found)


def test_a_reach_below_zero_is_refused():
    voxels = VoxelGrid().gaussians(np.zeros((10, 3)), 1.0)
    with pytest.raises(InvalidInput, match="reach must be a whole number of at least 0, got -1"):
        CellsAround(voxels, -1)
