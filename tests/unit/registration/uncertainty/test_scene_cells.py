import numpy as np

from reference.samples import street, yaw_pose
from scanlock.arrays import read_only
from scanlock.models.gaussians import Gaussians
from scanlock.optimisation.objectives.gaussian_scores import PointsToGaussians
from scanlock.registration.uncertainty.scene_cells import scene_cells

_POSE = yaw_pose(0.1, (0.5, -0.2, 0.0))


def _objective():
    rng = np.random.default_rng(0)
    means = street(1, 400)
    covariances = np.tile(np.diag([0.2, 0.3, 0.1]), (len(means), 1, 1))
    target = Gaussians.from_covariances(means, covariances, np.full(len(means), 10))
    points = _POSE.inverse().apply(means + rng.normal(0.0, 0.1, means.shape))
    return PointsToGaussians(target=target, points=read_only(points))


def test_cells_sum_to_the_whole_objective():
    objective = _objective()
    cells = scene_cells(objective, _POSE, side=8.0, min_side=0.5, min_blocks=20)
    assert cells is not None
    whole = objective.linearise(_POSE)
    np.testing.assert_allclose(cells.gradients.sum(axis=0), whole.gradient, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(cells.hessians.sum(axis=0), whole.hessian, rtol=1e-9, atol=1e-9)
    assert all(len(grid) == len(cells.gradients) for grid in cells.grids)


def test_centroids_lie_in_their_blocks():
    cells = scene_cells(_objective(), _POSE, side=8.0, min_side=0.5, min_blocks=20)
    assert cells is not None
    grid = cells.grids[0]
    in_source = _POSE.inverse().apply(cells.centroids)
    for block in range(int(grid.max()) + 1):
        assert np.ptp(in_source[grid == block], axis=0).max() < 8.0


def test_the_side_is_halved_while_there_are_too_few_blocks():
    objective = _objective()
    many = scene_cells(objective, _POSE, side=200.0, min_side=0.5, min_blocks=20)
    assert many is not None
    assert int(many.grids[0].max()) + 1 >= 20
    assert scene_cells(objective, _POSE, side=200.0, min_side=150.0, min_blocks=20) is None


def test_block_terms_are_restricted_to_the_free_directions():
    cells = scene_cells(_objective(), _POSE, side=8.0, min_side=0.5, min_blocks=20)
    assert cells is not None
    free = np.array([0, 1, 5])
    terms = cells.block_terms(free)
    np.testing.assert_array_equal(terms.gradients, cells.gradients[:, free])
    np.testing.assert_array_equal(terms.hessians, cells.hessians[:, free][:, :, free])
