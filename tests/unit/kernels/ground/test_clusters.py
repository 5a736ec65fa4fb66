import numpy as np
import pytest
from scipy.sparse import coo_array, csgraph

from reference import grouping
from scanlock.arrays import read_only
from scanlock.kernels.ground.clusters import (
    adjacent_cells,
    are_close,
    connected_components,
    occupied_cells,
    relabelled,
)


def test_occupied_cells_match_the_definition():
    rng = np.random.default_rng(5)
    for count in (0, 1, 40):
        cells = rng.integers(-1, 30, count)
        ranks, cell_of_rank = occupied_cells(read_only(cells), 30)
        expected_ranks, expected_cells = grouping.numbered(cells)
        np.testing.assert_array_equal(ranks, np.array(expected_ranks, np.int64))
        np.testing.assert_array_equal(cell_of_rank, np.array(expected_cells, np.int64))


@pytest.mark.parametrize(("sectors", "bins"), [(3, 1), (3, 4), (7, 5), (12, 9)])
def test_adjacent_cells_are_the_eight_neighbours(sectors, bins):
    rng = np.random.default_rng(sectors)
    for ratio in (0.0, 0.3, 1.0):
        occupied = np.flatnonzero(rng.random(sectors * bins) < ratio)
        first, second = adjacent_cells(read_only(occupied), sectors, bins)
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
def test_connected_components_match_scipy(seed):
    rng = np.random.default_rng(seed)
    rows = 60
    first, second = rng.integers(0, rows, (2, 70))
    joins = rng.random(70) < 0.6
    groups, count = connected_components(
        rows, read_only(first), read_only(second), read_only(joins)
    )
    ones = np.ones(joins.sum(), np.int8)
    graph = coo_array((ones, (first[joins], second[joins])), shape=(rows, rows))
    expected_count, expected = csgraph.connected_components(graph, directed=False)
    assert count == expected_count
    assert grouping.partition(groups) == grouping.partition(expected)
    firsts = [int(np.flatnonzero(groups == group)[0]) for group in range(count)]
    assert firsts == sorted(firsts)


def test_pairs_are_close_below_the_threshold_only():
    rng = np.random.default_rng(2)
    points = read_only(rng.normal(size=(30, 3)))
    first, second = rng.integers(0, 30, (2, 80))
    close = are_close(points, read_only(first), read_only(second), 1.3)
    distances = np.linalg.norm(points[first] - points[second], axis=1)
    np.testing.assert_array_equal(close, distances < 1.3)
    assert set(close.tolist()) == {True, False}
    ends = np.array([[0.0, 0.0, 0.0], [0.0, 0.75, 0.0]])
    pair = np.array([0]), np.array([1])
    assert not are_close(read_only(ends), *map(read_only, pair), 0.75)[0]


def test_labels_are_replaced_and_negative_ones_kept():
    labels, groups = np.array([2, -1, 0, 2, 1]), np.array([7, 4, 9])
    found = relabelled(read_only(labels), read_only(groups))
    assert found.tolist() == [9, -1, 7, 9, 4]
