import numpy as np
import pytest

from reference import neighbourhood_sums as reference
from scanlock.clouds.cell_list import CellList
from scanlock.errors import InvalidInput

_POINTS = np.random.default_rng(0).uniform(-6.0, 6.0, (400, 3))


@pytest.mark.parametrize("edge", [0.5, 2.0])
def test_what_is_near_does_not_depend_on_the_cubes(edge):
    places = _POINTS[::7] + 0.1
    found = CellList.of_points(_POINTS, edge).sums_near(places, 1.5)
    np.testing.assert_allclose(found, reference.sums_near(_POINTS, places, 1.5), atol=1e-9)


def test_it_cannot_be_written_to():
    listed = CellList.of_points(_POINTS, 1.0)
    with pytest.raises(ValueError, match="read-only"):
        listed.points[0, 0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        listed.starts[0] = 1


@pytest.mark.parametrize("edge", [0.0, -1.0, np.nan])
def test_an_edge_must_be_positive(edge):
    with pytest.raises(InvalidInput, match="edge must be"):
        CellList.of_points(_POINTS, edge)
