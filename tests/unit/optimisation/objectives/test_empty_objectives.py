"""Contract of all objectives: without terms they are zero, and solvers stop at once."""

import numpy as np
import pytest

from reference.samples import gaussians
from scanlock.arrays import read_only
from scanlock.clouds.point_tree import PointTree
from scanlock.geometry.pose import Pose
from scanlock.models.surface_points import SurfacePoints
from scanlock.models.voxel_gaussians import VoxelGrid
from scanlock.optimisation.objectives.associations import NearestAssociation, NeighbourCells
from scanlock.optimisation.objectives.cell_scores import CELL_ASSOCIATIONS, PointsToCells
from scanlock.optimisation.objectives.constraints import Constraints, PosePrior
from scanlock.optimisation.objectives.distribution_pairs import DistributionPairs
from scanlock.optimisation.objectives.gaussian_scores import GaussiansToGaussians, PointsToGaussians
from scanlock.optimisation.objectives.point_pairs import PointPairs
from scanlock.optimisation.solvers.bfgs import Bfgs
from scanlock.optimisation.solvers.criteria import StopReason
from scanlock.optimisation.solvers.gauss_newton import gauss_newton_step
from scanlock.optimisation.solvers.levenberg_marquardt import LevenbergMarquardt
from scanlock.optimisation.solvers.line_search import Armijo, StrongWolfe
from scanlock.optimisation.solvers.line_search_newton import LineSearchNewton
from scanlock.optimisation.solvers.more_thuente import MoreThuente
from scanlock.optimisation.solvers.newton import Newton

_FAR = Pose.from_step(np.array([1e4, -2e4, 3.0, 0.1, -0.2, 0.3]))

_NO_ROWS = read_only(np.zeros(0, np.int64))

_SOLVERS = [
    Newton(),
    LevenbergMarquardt(),
    *(kind(line_search=rule()) for kind in (LineSearchNewton, Bfgs)
      for rule in (Armijo, StrongWolfe, MoreThuente)),
]  # fmt: skip


def _points(count, seed=0):
    return read_only(np.random.default_rng(seed).uniform(-5.0, 5.0, (count, 3)))


def _gaussians(count):
    return gaussians(np.random.default_rng(1), count)


def _voxels(count):
    return VoxelGrid().gaussians(_points(100 * count), 3.0)


def _surface(count):
    packed = np.tile([0.1, 0.0, 0.0, 0.1, 0.0, 0.1], (count, 1))
    return SurfacePoints(_points(count), read_only(packed))


def _nearest(target, source):
    # A search tree needs a point.
    tree = PointTree.from_points(_gaussians(max(1, target)).means)
    return GaussiansToGaussians(
        target=_gaussians(max(1, target)),
        source=_gaussians(source),
        candidates=NearestAssociation(tree),
    )


def _neighbour_cells(target, source):
    voxels = _voxels(target)
    return GaussiansToGaussians(
        target=voxels.gaussians, source=_gaussians(source), candidates=NeighbourCells(voxels)
    )


def _distribution_pairs(target, source):
    none = read_only(np.full(source, -1))
    return DistributionPairs.at(_FAR, _surface(target), _surface(source), none)


def _point_pairs(target, source):
    return PointPairs(
        target=_points(target),
        source=_points(source),
        target_rows=_NO_ROWS,
        source_rows=_NO_ROWS,
        precisions=read_only(np.zeros((0, 6))),
    )


_OBJECTIVES = {
    "d2d": lambda t, s: GaussiansToGaussians(target=_gaussians(t), source=_gaussians(s)),
    "d2d nearest": _nearest,
    "d2d neighbour cells": _neighbour_cells,
    "p2d": lambda t, s: PointsToGaussians(target=_gaussians(t), points=_points(s)),
    "g-icp": _distribution_pairs,
    "icp": _point_pairs,
} | {
    name: lambda t, s, name=name: PointsToCells(
        target=_voxels(t), points=_points(s), association=name
    )
    for name in CELL_ASSOCIATIONS
}

_each_objective = pytest.mark.parametrize("name", _OBJECTIVES)
_each_size = pytest.mark.parametrize(
    ("target", "source"),
    [(20, 20), (20, 0), (0, 20), (0, 0)],
    ids=["out of range", "no source", "no target", "nothing"],
)


@_each_size
@_each_objective
def test_an_objective_without_terms_is_zero(name, target, source):
    objective = _OBJECTIVES[name](target, source)
    found = objective.linearise(_FAR)
    assert found.is_empty
    assert found.value == 0.0
    np.testing.assert_array_equal(found.gradient, np.zeros(6))
    np.testing.assert_array_equal(found.hessian, np.zeros((6, 6)))


@_each_size
@_each_objective
def test_contributions_without_terms_are_zero(name, target, source):
    objective = _OBJECTIVES[name](target, source)
    blocks = np.zeros(len(objective.positions), np.int64)
    found = objective.contributions(_FAR, blocks)
    count = min(1, len(blocks))
    np.testing.assert_array_equal(found.gradients, np.zeros((count, 6)))
    np.testing.assert_array_equal(found.hessians, np.zeros((count, 6, 6)))


@_each_size
@_each_objective
def test_solvers_return_the_start_of_an_objective_without_terms(name, target, source):
    objective = _OBJECTIVES[name](target, source)
    for solver in _SOLVERS:
        for dof in ("xyz+rpy", "xy+yaw"):
            solution = solver.minimise(Constraints(dof=dof).applied_to(objective), _FAR)
            assert solution.reason is StopReason.EMPTY_OBJECTIVE
            assert solution.pose == _FAR
            assert len(solution.history) == 1
            assert solution.quadratic.is_empty
    step = gauss_newton_step(objective.linearise(_FAR), 20.0)
    np.testing.assert_array_equal(step, np.zeros(6))


@pytest.mark.parametrize("name", ["p2d", "g-icp", "icp", "trilinear"])
def test_a_prior_without_any_observation_leaves_the_objective_empty(name):
    prior = PosePrior.from_deviations(Pose.identity(), 1.0, 0.1)
    objective = Constraints(prior=prior).applied_to(_OBJECTIVES[name](20, 0))
    assert objective.linearise(_FAR).is_empty
    for solver in _SOLVERS:
        assert solver.minimise(objective, _FAR).reason is StopReason.EMPTY_OBJECTIVE


@pytest.mark.parametrize("name", ["d2d", "p2d", "trilinear"])
def test_a_prior_alone_acts_on_scans_out_of_range(name):
    prior = PosePrior.from_deviations(_FAR, 1.0, 0.1)
    objective = _OBJECTIVES[name](20, 20)
    start = _FAR.retract(np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.0]))
    found = Constraints(prior=prior).applied_to(objective).linearise(start)
    expected = prior.linearise(start)
    np.testing.assert_allclose(found.value, expected.value / objective.count)
    np.testing.assert_allclose(found.gradient, expected.gradient / objective.count)
