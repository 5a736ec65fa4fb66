import numpy as np
import pytest

from reference import grouping
from scanlock.arrays import read_only
from scanlock.kernels.grouping import occupied_cells, split_by_extent


def _split(points, labels, parts, radius):
    return split_by_extent(read_only(points), read_only(labels), parts, radius)


def test_occupied_cells_match_the_definition():
    rng = np.random.default_rng(5)
    for count in (0, 1, 40):
        cells = rng.integers(-1, 30, count)
        parts, cell_of_part = occupied_cells(read_only(cells), 30)
        expected_parts, expected_cells = grouping.numbered(cells)
        np.testing.assert_array_equal(parts, np.array(expected_parts, np.int64))
        np.testing.assert_array_equal(cell_of_part, np.array(expected_cells, np.int64))


@pytest.mark.parametrize("radius", [0.8, 1.5, 4.0, 100.0])
def test_cuts_of_long_parts_match_the_definition(radius):
    # Walls and poles stay longer than wide at every cut, so their longest axis is clear; the
    # kernel need not find the axis of a round part to more than a few digits.
    rng = np.random.default_rng(8)
    walls = [rng.uniform(-0.5, 0.5, (150, 3)) * size for size in ([20, 0.2, 0.2], [0.1, 9, 0.1])]
    pole = rng.uniform(-0.5, 0.5, (150, 3)) * [0.1, 0.1, 7.0]
    points = np.concatenate([*walls, pole]) + rng.uniform(-30, 30, 3)
    labels = np.repeat([0, 1, 2], 150)
    cut, count = _split(points, labels, 3, radius)
    expected = set()
    for part in range(3):
        expected |= grouping.pieces(points, np.flatnonzero(labels == part).tolist(), radius)
    assert grouping.partition(cut) == expected
    assert count == len(expected)


@pytest.mark.parametrize("count", [1, 2, 7, 300])
def test_identical_points_stay_together(count):
    points = np.tile([3.1, -0.7, 12.3], (count, 1))
    labels, parts = _split(points, np.zeros(count, np.int64), 1, 1e-6)
    assert parts == 1
    np.testing.assert_array_equal(labels, 0)


@pytest.mark.parametrize("gap", [1e-3, 1.0, 1e9])
def test_two_points_part_only_when_each_is_too_far_from_their_mean(gap):
    points = np.array([[0.0, 0.0, 0.0], [gap, gap, 0.0]])
    half = np.sqrt(0.5) * gap
    together, count = _split(points, np.zeros(2, np.int64), 1, 1.01 * half)
    assert (count, set(together)) == (1, {0})
    apart, count = _split(points, np.zeros(2, np.int64), 1, 0.99 * half)
    assert (count, set(apart)) == (2, {0, 1})


def test_points_without_a_part_keep_none():
    labels = np.array([-1, 0, -1, 0])
    cut, count = _split(np.arange(12.0).reshape(4, 3), labels, 1, 1.0)
    assert count == 2
    np.testing.assert_array_equal(cut < 0, labels < 0)


def test_parts_without_points_get_no_number():
    cut, count = _split(np.zeros((2, 3)), np.array([3, 1]), 5, 1.0)
    assert count == 2
    assert sorted(cut) == [0, 1]
