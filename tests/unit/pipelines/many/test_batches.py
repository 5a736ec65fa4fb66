import itertools
import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from scanlock.pipelines.many.batches import Batches, BatchSize, sharing_order
from scanlock.pipelines.many.pair import Pair
from scanlock.pipelines.many.pair_row import PairRow

_SCANS = st.integers(0, 8).map(str)
_LISTS = st.lists(st.builds(lambda s, t: Pair(source=s, target=t), _SCANS, _SCANS), max_size=30)


@given(_LISTS)
def test_the_order_keeps_every_pair_once(pairs):
    assert sorted(sharing_order(pairs)) == list(range(len(pairs)))


@given(_LISTS)
def test_a_pair_shares_a_scan_with_an_earlier_one_unless_it_starts_a_new_group(pairs):
    def scans(pair):
        return {pair.source, pair.target}

    seen, ended = set(), set()
    for row in sharing_order(pairs):
        assert not scans(pairs[row]) & ended
        if seen and not scans(pairs[row]) & seen:
            ended |= seen
            seen = set()
        seen |= scans(pairs[row])


def test_pairs_of_one_scan_become_neighbours():
    pairs = [Pair(source=f"s{k}", target=f"t{k % 2}") for k in range(6)]
    assert sharing_order(pairs) == [0, 2, 4, 1, 3, 5]


@given(_LISTS, st.integers(1, 7), st.integers(1, 4))
def test_batches_hold_every_pair_once_and_are_no_larger_than_asked(pairs, size, workers):
    batches = Batches(iter(pairs))
    found = list(iter(lambda: batches.next(size, workers), None))
    assert all(len(batch.pairs) <= size for batch in found)
    numbered = {
        number: pair
        for batch in found
        for number, pair in zip(batch.numbers, batch.pairs, strict=True)
    }
    assert [numbered[k] for k in range(len(pairs))] == pairs


def test_a_list_without_end_is_read_two_rounds_ahead():
    taken = itertools.count()
    batches = Batches(Pair(source=str(next(taken)), target="t") for _ in itertools.count())
    assert len(batches.next(5, 2).pairs) == 5
    assert next(taken) == 20


@given(st.integers(1, 400), st.integers(1, 60), st.integers(1, 8))
def test_workers_end_within_a_twentieth_of_a_batch(count, size, workers):
    batches = Batches(Pair(source=str(k), target="t") for k in range(count))
    ends = [0] * workers
    for batch in iter(lambda: batches.next(size, workers), None):
        # The worker that is free first takes the next batch.
        first = ends.index(min(ends))
        ends[first] += len(batch.pairs)
    assert max(ends) - min(ends) <= max(1, math.ceil(size / 20))


def test_few_arrays_are_read_ahead():
    big = np.broadcast_to(np.float64(0.0), (30_000_000, 3))
    taken = itertools.count()
    batches = Batches(
        Pair(source=big, target=big, name=str(next(taken))) for _ in itertools.count()
    )
    for expected in (1, 2, 3):
        assert len(batches.next(100, 2).pairs) == 1
        assert next(taken) == 2 * expected - 1


def _rows(count, seconds):
    row = PairRow(name="", source="", target="", status="ok", reason="", seconds=seconds)
    return [row] * count


def test_the_size_of_batches_approaches_the_intended_duration():
    size = BatchSize(4, seconds=10.0)
    sizes = []
    for _ in range(8):
        size.adapt(_rows(size.pairs, 0.125))
        sizes.append(size.pairs)
    assert sizes == [8, 16, 32, 64, 80, 80, 80, 80]
    size.adapt(_rows(80, 60.0))
    assert size.pairs == 1
