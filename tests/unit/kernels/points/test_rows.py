import numpy as np
import pytest

from scanlock.arrays import read_only
from scanlock.kernels.points.rows import is_nonzero, selected_points


def test_only_exact_zeros_are_zero():
    points = np.array([[0.0, 0, 0], [0.0, 0, 1e-300], [3.0, 0, 0], [-0.0, 0, -0.0], [0, -2, 0]])
    assert is_nonzero(read_only(points)).tolist() == [False, True, True, False, True]


@pytest.mark.parametrize("ratio", [0.0, 0.4, 1.0])
def test_selected_points_are_those_of_the_mask(ratio):
    rng = np.random.default_rng(0)
    points = rng.normal(size=(40, 3))
    mask = rng.random(40) < ratio
    selected = selected_points(read_only(points), read_only(mask))
    np.testing.assert_array_equal(selected, points[mask])
