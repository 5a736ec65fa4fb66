import itertools

import numpy as np
import pytest

from scanlock.arrays import read_only
from scanlock.kernels.search.cliques import greedy_cliques, shared_neighbours


def _packed_bits(adjacency):
    count = len(adjacency)
    padded = np.zeros((count, 64 * ((count + 63) // 64)), np.uint8)
    padded[:, :count] = adjacency
    return read_only(np.packbits(padded, axis=1, bitorder="little").view("<u8").astype(np.uint64))


@pytest.fixture(name="graph")
def _graph():
    """A sparse random graph of 100 rows with a clique of eight in it."""
    rng = np.random.default_rng(2)
    adjacency = np.triu(rng.random((100, 100)) < 0.1, 1)
    members = rng.choice(100, 8, replace=False)
    for a, b in itertools.combinations(sorted(members), 2):
        adjacency[a, b] = True
    return adjacency | adjacency.T, set(members.tolist())


def test_shared_neighbours_are_counted(graph):
    adjacency, _ = graph
    pairs, shared = shared_neighbours(_packed_bits(adjacency))
    assert {tuple(pair) for pair in pairs} == set(zip(*np.nonzero(np.tril(adjacency)), strict=True))
    np.testing.assert_array_equal(shared, [(adjacency[a] & adjacency[b]).sum() for a, b in pairs])


def test_cliques_are_maximal_and_the_largest_comes_first(graph):
    adjacency, members = graph
    pairs, shared = shared_neighbours(_packed_bits(adjacency))
    order = np.argsort(-shared, kind="stable")
    sets = greedy_cliques(_packed_bits(adjacency), read_only(pairs[order]), 10, 20)
    assert set(sets[0].tolist()) - {-1} == members
    seen = set()
    for row in sets:
        one = row[row >= 0]
        assert len(one) > 2
        assert all(adjacency[a, b] for a, b in itertools.combinations(one, 2))
        assert not adjacency[one].all(axis=0).any()
        pair = frozenset(one[:2].tolist())
        assert pair not in seen
        seen |= {frozenset(two) for two in itertools.combinations(one.tolist(), 2)}
    assert (greedy_cliques(_packed_bits(adjacency), read_only(pairs[order]), 10, 5)[0] >= 0).all()


def test_a_graph_without_triangles_has_no_clique():
    ring = np.eye(10, k=1, dtype=bool) | np.eye(10, k=-1, dtype=bool)
    pairs, shared = shared_neighbours(_packed_bits(ring))
    assert len(pairs) == 9
    assert not shared.any()
    assert len(greedy_cliques(_packed_bits(ring), read_only(pairs), 5, 8)) == 0
