import pickle

import numpy as np
import pytest

from reference import ray_casting as reference
from scanlock.errors import InvalidInput
from scanlock.simulation.terrain.height_field import HeightField


def test_heights_are_interpolated_bilinearly():
    rng = np.random.default_rng(0)
    field = HeightField(rng.normal(size=(7, 12)), np.array([3.0, -2.0]), 0.5)
    positions = np.column_stack([rng.uniform(3, 6, 100), rng.uniform(-2, 3.5, 100)])
    expected = [reference.height(field.heights, field.corner, 0.5, x, y) for x, y in positions]
    np.testing.assert_allclose(field.at(positions), expected, atol=1e-12)
    np.testing.assert_array_equal(
        field.lifted(positions), np.column_stack([positions, field.at(positions)])
    )


def test_heights_outside_are_those_of_the_nearest_edge():
    field = HeightField(np.array([[0.0, 1.0], [2.0, 3.0]]), np.zeros(2), 1.0)
    assert field.at(np.array([[-5.0, -5.0], [9.0, 9.0], [9.0, -1.0]])).tolist() == [0.0, 3.0, 2.0]


def test_a_sampled_field_covers_its_rectangle_and_interpolates_the_function():
    field = HeightField.sampled(lambda xy: xy[:, 0] * xy[:, 1], (-1.0, 2.0), (1.1, 4.0), 0.5)
    assert field.heights.shape == (6, 5)
    assert field.heights[2, 1] == 0.0 * 2.5
    assert field.heights[4, 3] == 1.0 * 3.5


def test_the_top_of_a_tile_is_its_maximum_height_with_its_border():
    heights = np.zeros((18, 9))
    heights[8, 3] = 5.0
    heights[17, 8] = 2.0
    field = HeightField(heights, np.zeros(2), 1.0)
    assert field.tops.tolist() == [[5.0], [5.0], [2.0]]


def test_a_field_is_a_read_only_copy_and_can_be_pickled():
    heights = np.ones((3, 3))
    field = HeightField(heights, np.zeros(2), 1.0)
    heights[:] = 7.0
    back = pickle.loads(pickle.dumps(field))
    for array in (field.heights, field.corner, field.tops, back.heights):
        assert not array.flags.writeable
    np.testing.assert_array_equal(back.heights, np.ones((3, 3)))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((np.zeros((1, 5)), np.zeros(2), 1.0), r"at least \(2, 2\), got \(1, 5\)"),
        ((np.zeros(5), np.zeros(2), 1.0), "heights must be a grid"),
        ((np.zeros((2, 2)), np.zeros(3), 1.0), r"corner must have shape \(2,\), got \(3,\)"),
        ((np.full((2, 2), np.nan), np.zeros(2), 1.0), "must be finite"),
        ((np.zeros((2, 2)), np.zeros(2), 0.0), "cell must be positive, got 0.0 m"),
    ],
)
def test_invalid_fields_are_refused(arguments, message):
    with pytest.raises(InvalidInput, match=message):
        HeightField(*arguments)
