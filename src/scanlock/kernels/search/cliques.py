"""Sets of matches that all agree, in a graph whose neighbours are bits of words.

With 64 neighbours to a word, those that two matches share are counted 64 at a time.
"""

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Labels
from scanlock.kernels._compile import kernel

Words = NDArray[np.uint64]


@kernel
def shared_neighbours(graph: Words) -> tuple[Labels, Labels]:
    """Return the (e, 2) pairs of neighbours in an (m, w) graph, and how many they share.

    The larger row comes first in a pair. Wrong matches that happen to agree share few.
    """
    m, words = graph.shape
    count = 0
    for a in range(m):
        for w in range(words):
            count += _ones(graph[a, w])
    pairs = np.empty((count // 2, 2), np.int64)
    shared = np.zeros(count // 2, np.int64)
    k = 0
    for a in range(m):
        for b in range(a):
            if (graph[a, b >> 6] >> np.uint64(b & 63)) & np.uint64(1):
                pairs[k, 0], pairs[k, 1] = a, b
                for w in range(words):
                    shared[k] += _ones(graph[a, w] & graph[b, w])
                k += 1
    return pairs, shared


@kernel
def grown_sets(graph: Words, pairs: Labels, most: int, largest: int) -> Labels:
    """Return up to `most` (s, largest) sets of rows that are all neighbours; -1 fills up.

    Each grows from the first of the (e, 2) pairs that lies in no earlier set, by the row that
    leaves the most candidates, until none is left or the set is full. Sets of two are left out.
    """
    m, words = graph.shape
    sets = np.full((most, largest), -1, np.int64)
    spent = np.zeros((m, words), np.uint64)
    left = np.empty(words, np.uint64)
    n = 0
    for k in range(pairs.shape[0]):
        if n == most:
            break
        a, b = pairs[k, 0], pairs[k, 1]
        if (spent[a, b >> 6] >> np.uint64(b & 63)) & np.uint64(1):
            continue
        size = 2
        sets[n, 0], sets[n, 1] = a, b
        for w in range(words):
            left[w] = graph[a, w] & graph[b, w]
        while size < largest:
            best = _best_candidate(graph, left)
            if best < 0:
                break
            sets[n, size] = best
            size += 1
            for w in range(words):
                left[w] &= graph[best, w]
        for i in range(size):
            for j in range(size):
                other = sets[n, j]
                spent[sets[n, i], other >> 6] |= np.uint64(1) << np.uint64(other & 63)
        if size > 2:
            n += 1
        else:
            sets[n, :2] = -1
    return sets[:n]


@kernel
def _best_candidate(graph: Words, left: Words) -> int | np.int64:
    """Return the row among the bits of `left` with the most neighbours there; -1 without any."""
    best, most = -1, -1
    for w in range(left.shape[0]):
        rest = left[w]
        while rest != 0:
            lowest = rest & (~rest + np.uint64(1))
            rest ^= lowest
            row = 64 * w + _ones(lowest - np.uint64(1))
            count = 0
            for u in range(left.shape[0]):
                count += _ones(left[u] & graph[row, u])
            if count > most:
                best, most = row, count
    return best


@kernel
def _ones(word: np.uint64) -> np.int64:
    """Return how many bits of a word are set."""
    word -= (word >> np.uint64(1)) & np.uint64(0x5555555555555555)
    word = (word & np.uint64(0x3333333333333333)) + (
        (word >> np.uint64(2)) & np.uint64(0x3333333333333333)
    )
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return np.int64((word * np.uint64(0x0101010101010101)) >> np.uint64(56))
