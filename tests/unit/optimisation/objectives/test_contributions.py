import numpy as np
import pytest

from reference.samples import gaussians
from scanlock.arrays import read_only
from scanlock.clouds.point_tree import PointTree
from scanlock.geometry.pose import Pose
from scanlock.models.surface_points import SurfacePoints
from scanlock.models.voxel_gaussians import VoxelGrid
from scanlock.optimisation.objectives.associations import NearestAssociation
from scanlock.optimisation.objectives.cell_scores import PointsToCells
from scanlock.optimisation.objectives.distribution_pairs import DistributionPairs
from scanlock.optimisation.objectives.gaussian_scores import GaussiansToGaussians, PointsToGaussians
from scanlock.optimisation.objectives.point_pairs import PointPairs, point_precisions
from scanlock.optimisation.solvers.problem import Separable, rows_by_block

_POSE = Pose.from_step(np.array([0.2, -0.1, 0.1, 0.02, -0.01, 0.03]))

_NAMES = ["d2d", "d2d nearest", "p2d", "near-cells", "trilinear", "g-icp", "icp"]


def _objectives():
    rng = np.random.default_rng(3)
    target, source = gaussians(rng, 60), gaussians(rng, 50)
    points = read_only(rng.uniform(-10.0, 10.0, (80, 3)))
    rows = read_only(rng.integers(80, size=50))
    cells = VoxelGrid().gaussians(read_only(rng.uniform(-10.0, 10.0, (4000, 3))), 4.0)
    packed = read_only(np.tile([0.1, 0.0, 0.0, 0.1, 0.0, 0.1], (80, 1)))
    surface = SurfacePoints(points, packed)
    tree = PointTree.from_points(target.means)
    yield "d2d", GaussiansToGaussians(target=target, source=source)
    yield (
        "d2d nearest",
        GaussiansToGaussians(target=target, source=source, candidates=NearestAssociation(tree)),
    )
    yield "p2d", PointsToGaussians(target=target, points=points)
    for association in ("near-cells", "trilinear"):
        yield association, PointsToCells(target=cells, points=points, association=association)
    correspondences = np.where(rng.random(80) < 0.7, rng.integers(80, size=80), -1)
    yield "g-icp", DistributionPairs.at(_POSE, surface, surface, read_only(correspondences))
    yield (
        "icp",
        PointPairs(
            target=points,
            source=points,
            target_rows=read_only(rows[::-1]),
            source_rows=rows,
            precisions=read_only(point_precisions(rng.random(50))),
        ),
    )


@pytest.mark.parametrize("name", _NAMES)
def test_contributions_sum_to_the_whole(name):
    objective = dict(_objectives())[name]
    assert isinstance(objective, Separable), name
    blocks = np.arange(len(objective.positions)) * 7 % 5
    whole, found = objective.linearise(_POSE), objective.contributions(_POSE, blocks)
    assert len(found.gradients) == 5
    for values, sums in ((found.gradients, whole.gradient), (found.hessians, whole.hessian)):
        atol = 1e-9 * np.abs(values).sum()
        np.testing.assert_allclose(values.sum(axis=0), sums, rtol=1e-9, atol=atol)


@pytest.mark.parametrize("name", _NAMES)
def test_a_contribution_is_that_of_its_own_elements(name):
    objective = dict(_objectives())[name]
    positions = objective.positions
    each = objective.contributions(_POSE, np.arange(len(positions))).gradients
    strongest = int(np.argmax(np.linalg.norm(each, axis=1)))
    blocks = (np.arange(len(positions)) == strongest).astype(np.int64)
    others, alone = objective.contributions(_POSE, blocks).gradients
    whole = objective.linearise(_POSE).gradient
    np.testing.assert_allclose(alone, each[strongest], rtol=1e-9)
    np.testing.assert_allclose(alone, whole - others, atol=1e-9)
    # The torque of an element about the origin is bounded by its distance and its size.
    y = _POSE.apply(positions[strongest])
    assert np.linalg.norm(alone[3:]) <= (np.linalg.norm(y) + 5.0) * np.linalg.norm(alone[:3])


def test_rows_are_sorted_by_block():
    order, runs = rows_by_block(np.array([2, 0, 1, 0, 2]))
    assert [order[run].tolist() for run in runs] == [[1, 3], [2], [0, 4]]
