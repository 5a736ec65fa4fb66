import numpy as np
import pytest

from reference import neighbourhood_sums as reference
from scanlock.clouds.cell_list import CellList
from scanlock.errors import InvalidInput

_POINTS = np.random.default_rng(0).uniform(-6.0, 6.0, (400, 3))


@pytest.mark.parametrize("voxel_size", [0.5, 2.0])
def test_sums_within_a_radius_do_not_depend_on_the_voxel_size(voxel_size):
    queries = _POINTS[::7] + 0.1
    found = CellList.of_points(_POINTS, voxel_size).sums_within_radius(queries, 1.5)
    np.testing.assert_allclose(
        found, reference.sums_within_radius(_POINTS, queries, 1.5), atol=1e-9
    )


def test_arrays_are_read_only():
    cells = CellList.of_points(_POINTS, 1.0)
    with pytest.raises(ValueError, match="read-only"):
        cells.points[0, 0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        cells.starts[0] = 1


@pytest.mark.parametrize("voxel_size", [0.0, -1.0, np.nan])
def test_the_voxel_size_must_be_positive(voxel_size):
    with pytest.raises(InvalidInput, match="voxel_size must be"):
        CellList.of_points(_POINTS, voxel_size)
