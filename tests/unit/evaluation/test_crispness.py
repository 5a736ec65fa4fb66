import numpy as np
import pytest

from scanlock.errors import InvalidInput
from scanlock.evaluation.crispness import crispness, streamed_crispness


def _slow(points, voxel_size):
    return len({tuple(np.floor(point / voxel_size).astype(int)) for point in points})


@pytest.mark.parametrize("voxel_size", [0.1, 0.37, 2.0])
def test_crispness_counts_the_occupied_voxels(voxel_size):
    points = np.random.default_rng(0).normal(0.0, 3.0, (2000, 3))
    assert crispness(points, voxel_size) == _slow(points, voxel_size)


def test_chunks_of_a_map_count_as_the_whole():
    points = np.random.default_rng(1).normal(0.0, 1.0, (5000, 3))
    chunks = np.array_split(points, 7)
    assert streamed_crispness(chunks) == crispness(points)
    assert streamed_crispness(iter(chunks)) == streamed_crispness(chunks[::-1])


def test_duplicate_points_do_not_count_and_a_shifted_copy_does():
    wall = np.column_stack([*np.mgrid[0:5:0.05, 0:3:0.05].reshape(2, -1), np.full(6000, 0.05)])
    once = crispness(wall)
    assert crispness(np.vstack([wall, wall])) == once
    assert crispness(np.vstack([wall, wall + np.array([0.0, 0.0, 0.3])])) == 2 * once


def test_many_small_chunks_count_as_the_whole():
    rng = np.random.default_rng(2)
    chunks = [rng.normal(0.02 * k, 1.0, (rng.integers(0, 300), 3)) for k in range(120)]
    assert streamed_crispness(chunks) == _slow(np.concatenate(chunks), 0.1)


def test_shifts_by_whole_voxels_keep_the_count_and_others_do_not():
    wall = np.column_stack([*np.mgrid[0:5:0.05, 0:3:0.05].reshape(2, -1), np.full(6000, 0.05)])
    # A power of two, so that shifted coordinates are exact.
    voxel_size = 0.125
    count = crispness(wall, voxel_size)
    for shift in ([1.0, -2.0, 0.5], [4096.0, -8192.0, 16.0]):
        assert crispness(wall + np.array(shift), voxel_size) == count
    rough = wall + np.random.default_rng(4).normal(0.0, 0.02, wall.shape)
    shifted = crispness(rough + np.array([0.0, 0.0, 0.07]), voxel_size)
    assert shifted > 1.3 * crispness(rough, voxel_size)


def test_an_empty_map_has_no_occupied_voxel():
    assert crispness(np.empty((0, 3))) == 0
    assert streamed_crispness([]) == 0


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (np.zeros((4, 2)), r"shape \(n, 3\)"),
        (np.full((1, 3), np.nan), "finite and within 104858 m"),
        (np.full((1, 3), 2e5), "subtract the map's origin first"),
    ],
)
def test_invalid_points_and_voxel_sizes_are_refused(points, message):
    with pytest.raises(InvalidInput, match=message):
        crispness(points)
    with pytest.raises(InvalidInput, match="voxel_size must be positive"):
        crispness(np.zeros((1, 3)), 0.0)
