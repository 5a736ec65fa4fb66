import numpy as np
import pytest

from scanlock.clouds.distance_field import DistanceField
from scanlock.errors import InvalidInput


def _points():
    return np.random.default_rng(0).uniform(-6.0, 6.0, (40, 3))


def test_it_is_the_distance_to_the_nearest_point_to_within_the_cubes():
    points = _points()
    field = DistanceField.from_points(points, 0.25, 3.0)
    queries = np.random.default_rng(1).uniform(-6.0, 6.0, (500, 3))
    exact = np.linalg.norm(queries[:, None] - points, axis=2).min(axis=1)
    # Either end moves to the middle of its cube: by half a diagonal at most.
    assert np.abs(field.at(queries) - np.minimum(exact, 3.0)).max() <= 0.25 * np.sqrt(3.0)


def test_beyond_the_truncation_all_is_equally_far():
    field = DistanceField.from_points(_points(), 0.5, 2.0)
    np.testing.assert_array_equal(field.at(np.array([[50.0, 0, 0], [0, 0, -1e6]])), 2.0)
    assert field.distances.max() == 2.0
    assert not field.distances.flags.writeable


def test_a_stray_does_not_size_the_grid():
    strays = np.vstack([_points(), [[1e5, 0.0, 0.0]]])
    field = DistanceField.from_points(strays, 0.5, 2.0)
    assert field.distances.shape == DistanceField.from_points(_points(), 0.5, 2.0).distances.shape


def test_what_makes_no_field_is_refused():
    with pytest.raises(InvalidInput, match="points must hold at least one"):
        DistanceField.from_points(np.empty((0, 3)), 0.5, 2.0)
    with pytest.raises(InvalidInput, match="width must be positive"):
        DistanceField.from_points(_points(), 0.0, 2.0)
