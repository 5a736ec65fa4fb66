import numpy as np
import pytest

from scanlock.clouds.distance_field import DistanceField
from scanlock.errors import InvalidInput


def _points():
    return np.random.default_rng(0).uniform(-6.0, 6.0, (40, 3))


def test_distances_are_accurate_to_the_voxels():
    points = _points()
    field = DistanceField.from_points(points, 0.25, 3.0)
    queries = np.random.default_rng(1).uniform(-6.0, 6.0, (500, 3))
    exact = np.linalg.norm(queries[:, None] - points, axis=2).min(axis=1)
    # Either end moves to the centre of its voxel, by half a diagonal at most.
    assert np.abs(field.at(queries) - np.minimum(exact, 3.0)).max() <= 0.25 * np.sqrt(3.0)


def test_distances_are_truncated():
    field = DistanceField.from_points(_points(), 0.5, 2.0)
    np.testing.assert_array_equal(field.at(np.array([[50.0, 0, 0], [0, 0, -1e6]])), 2.0)
    assert field.distances.max() == 2.0
    assert not field.distances.flags.writeable


def test_an_outlier_does_not_enlarge_the_grid():
    points = np.vstack([_points(), [[1e5, 0.0, 0.0]]])
    field = DistanceField.from_points(points, 0.5, 2.0)
    assert field.distances.shape == DistanceField.from_points(_points(), 0.5, 2.0).distances.shape


def test_invalid_input_is_rejected():
    with pytest.raises(InvalidInput, match="points must contain at least one"):
        DistanceField.from_points(np.empty((0, 3)), 0.5, 2.0)
    with pytest.raises(InvalidInput, match="voxel_size must be positive"):
        DistanceField.from_points(_points(), 0.0, 2.0)


def test_a_cloud_without_points_near_its_median_is_far_from_everything():
    points = np.array([[-1e6, 0.0, 0.0], [1e6, 0.0, 0.0]])
    field = DistanceField.from_points(points, 0.5, 2.0)
    np.testing.assert_array_equal(field.at(np.array([[0.0, 0.0, 0.0], [5.0, 5.0, 5.0]])), 2.0)
