"""Greedy cliques in a compatibility graph with neighbours as bits.

An unsigned word has 64 neighbours, so common neighbours of two matches are counted 64 at a time.
"""

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Labels
from scanlock.kernels._compile import helper, kernel

Words = NDArray[np.uint64]


@kernel
def shared_neighbours(graph: Words) -> tuple[Labels, Labels]:
    """Return the (e, 2) edges of an (m, w) graph and their numbers of common neighbours (e,).

    The larger row comes first in an edge. Wrong matches that are consistent by chance have few
    common neighbours.
    """
    m, words = graph.shape
    count = 0
    for a in range(m):
        for w in range(words):
            count += _count_ones(graph[a, w])
    edges = np.empty((count // 2, 2), np.int64)
    shared = np.zeros(count // 2, np.int64)
    k = 0
    for a in range(m):
        for b in range(a):
            if (graph[a, b >> 6] >> np.uint64(b & 63)) & np.uint64(1):
                edges[k, 0], edges[k, 1] = a, b
                for w in range(words):
                    shared[k] += _count_ones(graph[a, w] & graph[b, w])
                k += 1
    return edges, shared


@kernel
def greedy_cliques(graph: Words, edges: Labels, max_cliques: int, max_size: int) -> Labels:
    """Return up to `max_cliques` cliques as (s, max_size) rows of the graph, padded by -1.

    Each grows from the first of the (e, 2) edges that is in no earlier clique. It takes the row
    that leaves the most candidates, until there is none or the clique has its maximum size.
    Cliques of two are left out.
    """
    m, words = graph.shape
    cliques = np.full((max_cliques, max_size), -1, np.int64)
    used = np.zeros((m, words), np.uint64)
    left = np.empty(words, np.uint64)
    n = 0
    for k in range(edges.shape[0]):
        if n == max_cliques:
            break
        a, b = edges[k, 0], edges[k, 1]
        if (used[a, b >> 6] >> np.uint64(b & 63)) & np.uint64(1):
            continue
        size = 2
        cliques[n, 0], cliques[n, 1] = a, b
        for w in range(words):
            left[w] = graph[a, w] & graph[b, w]
        while size < max_size:
            best = _best_candidate(graph, left)
            if best < 0:
                break
            cliques[n, size] = best
            size += 1
            for w in range(words):
                left[w] &= graph[best, w]
        for i in range(size):
            for j in range(size):
                other = cliques[n, j]
                used[cliques[n, i], other >> 6] |= np.uint64(1) << np.uint64(other & 63)
        if size > 2:
            n += 1
        else:
            cliques[n, :2] = -1
    return cliques[:n]


@helper
def _best_candidate(graph: Words, left: Words) -> int | np.int64:
    """Return the row among the bits of `left` with the most neighbours there; -1 if none is."""
    best, best_count = -1, -1
    for w in range(left.shape[0]):
        rest = left[w]
        while rest != 0:
            lowest = rest & (~rest + np.uint64(1))
            rest ^= lowest
            row = 64 * w + _count_ones(lowest - np.uint64(1))
            count = 0
            for u in range(left.shape[0]):
                count += _count_ones(left[u] & graph[row, u])
            if count > best_count:
                best, best_count = row, count
    return best


@helper
def _count_ones(word: np.uint64) -> np.int64:
    """Return the number of bits of a word that are 1."""
    word -= (word >> np.uint64(1)) & np.uint64(0x5555555555555555)
    word = (word & np.uint64(0x3333333333333333)) + (
        (word >> np.uint64(2)) & np.uint64(0x3333333333333333)
    )
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return np.int64((word * np.uint64(0x0101010101010101)) >> np.uint64(56))
