import numpy as np
import pytest

from scanlock.errors import InvalidInput
from scanlock.evaluation.crispness import crispness, streamed_crispness


def _slow(points, width):
    return len({tuple(np.floor(point / width).astype(int)) for point in points})


@pytest.mark.parametrize("width", [0.1, 0.37, 2.0])
def test_it_counts_the_voxels_that_hold_a_point(width):
    points = np.random.default_rng(0).normal(0.0, 3.0, (2000, 3))
    assert crispness(points, width) == _slow(points, width)


def test_parts_of_a_map_count_as_the_whole():
    points = np.random.default_rng(1).normal(0.0, 1.0, (5000, 3))
    parts = np.array_split(points, 7)
    assert streamed_crispness(parts) == crispness(points)
    assert streamed_crispness(iter(parts)) == streamed_crispness(parts[::-1])


def test_the_same_points_again_add_nothing_and_a_blurred_copy_does():
    wall = np.column_stack([*np.mgrid[0:5:0.05, 0:3:0.05].reshape(2, -1), np.full(6000, 0.05)])
    once = crispness(wall)
    assert crispness(np.vstack([wall, wall])) == once
    assert crispness(np.vstack([wall, wall + np.array([0.0, 0.0, 0.3])])) == 2 * once


def test_a_large_map_in_many_small_parts_counts_as_the_whole():
    rng = np.random.default_rng(2)
    parts = [rng.normal(0.02 * k, 1.0, (rng.integers(0, 300), 3)) for k in range(120)]
    assert streamed_crispness(parts) == _slow(np.concatenate(parts), 0.1)


def test_moving_a_map_by_whole_voxels_changes_nothing_and_by_parts_of_one_it_does():
    wall = np.column_stack([*np.mgrid[0:5:0.05, 0:3:0.05].reshape(2, -1), np.full(6000, 0.05)])
    # A power of two, so that shifted coordinates are exact.
    width = 0.125
    count = crispness(wall, width)
    for shift in ([1.0, -2.0, 0.5], [4096.0, -8192.0, 16.0]):
        assert crispness(wall + np.array(shift), width) == count
    rough = wall + np.random.default_rng(4).normal(0.0, 0.02, wall.shape)
    assert crispness(rough + np.array([0.0, 0.0, 0.07]), width) > 1.3 * crispness(rough, width)


def test_an_empty_map_fills_nothing():
    assert crispness(np.empty((0, 3))) == 0
    assert streamed_crispness([]) == 0


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (np.zeros((4, 2)), r"shape \(n, 3\)"),
        (np.full((1, 3), np.nan), "finite and within 104858 m"),
        (np.full((1, 3), 2e5), "take the map's origin off"),
    ],
)
def test_what_is_no_map_is_refused(points, message):
    with pytest.raises(InvalidInput, match=message):
        crispness(points)
    with pytest.raises(InvalidInput, match="width must be positive"):
        crispness(np.zeros((1, 3)), 0.0)
