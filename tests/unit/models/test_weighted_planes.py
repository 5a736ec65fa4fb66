"""Planes of the nearest points, near points weighted more."""

import numpy as np
import pytest

from scanlock.arrays import read_only
from scanlock.clouds.point_tree import PointTree
from scanlock.geometry.rotations import exp_rotation
from scanlock.models.weighted_planes import WeightedPlanes


@pytest.fixture
def rng():
    return np.random.default_rng(7)


def _tree(points):
    return PointTree.from_points(read_only(np.ascontiguousarray(points)))


@pytest.fixture
def ground(rng):
    return np.column_stack([rng.uniform(-5.0, 5.0, (600, 2)), np.zeros(600)])


def test_the_points_of_a_plane_give_that_plane(rng, ground):
    rotation = exp_rotation(np.array([0.4, -0.3, 0.2]))
    positions = rng.uniform(-3.0, 3.0, (50, 3)) * [1.0, 1.0, 0.1]
    found = WeightedPlanes.around(positions @ rotation.T, _tree(ground @ rotation.T), 10, 2.0)
    good = found.is_plane
    # The nearest points of the others happen to lie on one side of them.
    assert good.mean() > 0.9
    np.testing.assert_allclose(np.abs(found.normals[good] @ rotation[:, 2]), 1.0, atol=1e-9)
    residuals = ((positions @ rotation.T - found.means) * found.normals).sum(axis=1)
    np.testing.assert_allclose(np.abs(residuals[good]), np.abs(positions[good, 2]), atol=1e-9)
    np.testing.assert_allclose(found.variances[good], 0.0, atol=1e-12)


def test_the_variance_is_that_of_the_noise(rng, ground):
    noisy = ground + rng.normal(0.0, 0.05, ground.shape) * [0.0, 0.0, 1.0]
    found = WeightedPlanes.around(noisy, _tree(noisy), 16, 2.0)
    assert np.sqrt(found.variances[found.is_plane].mean()) == pytest.approx(0.05, rel=0.15)


def test_positions_beyond_the_border_have_no_plane(ground):
    positions = np.array([[0.0, 0.0, 0.0], [7.0, 0.0, 0.0], [0.0, 30.0, 0.0]])
    found = WeightedPlanes.around(positions, _tree(ground), 10, 2.0)
    assert found.is_plane.tolist() == [True, False, False]


def test_points_on_a_line_have_no_plane(rng):
    line = np.column_stack([rng.uniform(-5.0, 5.0, 100), np.zeros((100, 2))])
    assert not WeightedPlanes.around(line, _tree(line), 10, 2.0).is_plane.any()


def test_a_cloud_of_few_or_equal_points_has_no_plane(rng):
    positions = rng.normal(size=(5, 3))
    for points in (np.zeros((3, 3)), np.ones((20, 3))):
        assert not WeightedPlanes.around(positions, _tree(points), 10, 9.0).is_plane.any()
