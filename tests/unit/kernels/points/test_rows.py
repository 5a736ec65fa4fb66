import numpy as np
import pytest

from scanlock.arrays import read_only
from scanlock.kernels.points.rows import is_nonzero, selected_points


def test_only_points_at_exactly_zero_are_at_zero():
    points = np.array([[0.0, 0, 0], [0.0, 0, 1e-300], [3.0, 0, 0], [-0.0, 0, -0.0], [0, -2, 0]])
    assert is_nonzero(read_only(points)).tolist() == [False, True, True, False, True]


@pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
def test_chosen_points_are_those_of_the_mask(share):
    rng = np.random.default_rng(0)
    points = rng.normal(size=(40, 3))
    mask = rng.random(40) < share
    chosen = selected_points(read_only(points), read_only(mask))
    np.testing.assert_array_equal(chosen, points[mask])
