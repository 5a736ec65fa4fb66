import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from reference import grouping
from scanlock.arrays import read_only
from scanlock.kernels.grouping import joined_groups, occupied_cells, touching_cells


def test_occupied_cells_match_the_definition():
    rng = np.random.default_rng(5)
    for count in (0, 1, 40):
        cells = rng.integers(-1, 30, count)
        parts, cell_of_part = occupied_cells(read_only(cells), 30)
        expected_parts, expected_cells = grouping.numbered(cells)
        np.testing.assert_array_equal(parts, np.array(expected_parts, np.int64))
        np.testing.assert_array_equal(cell_of_part, np.array(expected_cells, np.int64))


@pytest.mark.parametrize(("sectors", "bins"), [(3, 1), (3, 4), (7, 5), (12, 9)])
def test_touching_cells_are_the_eight_around_each(sectors, bins):
    rng = np.random.default_rng(sectors)
    for share in (0.0, 0.3, 1.0):
        occupied = np.flatnonzero(rng.random(sectors * bins) < share)
        first, second = touching_cells(read_only(occupied), sectors, bins)
        found = [frozenset(pair) for pair in zip(first.tolist(), second.tolist(), strict=True)]
        expected = set()
        for i, one in enumerate(occupied):
            for j, other in enumerate(occupied[:i]):
                across = abs(one // bins - other // bins)
                if min(across, sectors - across) <= 1 and abs(one % bins - other % bins) <= 1:
                    expected.add(frozenset((i, j)))
        assert len(found) == len(expected)
        assert set(found) == expected


@pytest.mark.parametrize("seed", range(4))
def test_joined_groups_are_the_connected_components(seed):
    rng = np.random.default_rng(seed)
    rows = 60
    first, second = rng.integers(0, rows, (2, 70))
    joins = rng.random(70) < 0.6
    groups, count = joined_groups(rows, read_only(first), read_only(second), read_only(joins))
    ones = np.ones(joins.sum(), np.int8)
    graph = coo_array((ones, (first[joins], second[joins])), shape=(rows, rows))
    expected_count, expected = connected_components(graph, directed=False)
    assert count == expected_count
    assert grouping.partition(groups) == grouping.partition(expected)
    firsts = [int(np.flatnonzero(groups == group)[0]) for group in range(count)]
    assert firsts == sorted(firsts)
