import numpy as np
import pytest

from scanlock.errors import InvalidInput
from scanlock.evaluation.crispness import crispness
from scanlock.evaluation.voxel_map import VoxelMap

RNG = np.random.default_rng(0)
PARTS = [RNG.normal(0.0, 1.0, (500, 3)) for _ in range(7)]


def test_as_many_points_are_kept_as_voxels_are_filled():
    laid = VoxelMap(0.1)
    for part in PARTS:
        laid.add(part)
    everything = np.concatenate(PARTS)
    assert len(laid) == len(laid.points) == crispness(everything, 0.1)
    kept = {tuple(row) for row in laid.points.tolist()}
    assert kept <= {tuple(row) for row in everything.astype(np.float32).tolist()}


def test_the_first_point_of_a_voxel_is_the_one_that_is_kept():
    laid = VoxelMap(1.0)
    laid.add(np.array([[0.2, 0.2, 0.2], [0.1, 0.1, 0.1], [5.5, 0.5, 0.5]]))
    laid.add(np.array([[0.9, 0.9, 0.9], [-0.5, 0.5, 0.5]]))
    np.testing.assert_allclose(
        laid.points, [[-0.5, 0.5, 0.5], [0.2, 0.2, 0.2], [5.5, 0.5, 0.5]], rtol=1e-6
    )


def test_asking_in_between_changes_nothing():
    one, other = VoxelMap(0.1), VoxelMap(0.1)
    for part in PARTS:
        one.add(part)
        other.add(part)
        assert len(other) > 0
    np.testing.assert_array_equal(one.points, other.points)


def test_nothing_is_an_empty_map():
    laid = VoxelMap(0.1)
    laid.add(np.zeros((0, 3)))
    assert (len(laid), laid.points.shape) == (0, (0, 3))


def test_places_without_a_voxel_number_are_refused():
    with pytest.raises(InvalidInput, match="within 104858 m"):
        VoxelMap(0.1).add(np.array([[2e5, 0.0, 0.0]]))
    with pytest.raises(InvalidInput, match="width must be positive"):
        VoxelMap(0.0)
