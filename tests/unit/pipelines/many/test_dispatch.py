import itertools
from concurrent.futures import Future
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scanlock.pipelines.many import dispatch
from scanlock.pipelines.many.cluster import ClusterWorkers, WorkersLost
from scanlock.pipelines.many.dispatch import Dispatch
from scanlock.pipelines.many.pair import Pair
from scanlock.pipelines.many.pair_row import PairRow


class Died(Exception):
    pass


class FakeWorkers:
    """Workers that end batches in a given order, and die of the pairs named killer."""

    first_size, batch_seconds, ahead, max_deaths = 4, 1.0, 2, 2

    def __init__(self, choose=lambda count: 0, shared_fate=True):
        self.running, self.closed = [], False
        self._choose, self._shared_fate = choose, shared_fate

    def count(self):
        return 2

    def submit(self, batch):
        future = Future()
        self.running.append((future, batch))
        if len(self.running) == self.count() * self.ahead or batch.is_suspect:
            self._end_one()
        return future

    def _end_one(self):
        future, batch = self.running.pop(self._choose(len(self.running)))
        if any(pair.name == "killer" for pair in batch.pairs):
            future.set_exception(Died())
            if self._shared_fate:
                for other, _ in self.running:
                    other.set_exception(Died())
                self.running.clear()
        else:
            future.set_result([_row(pair) for pair in batch.pairs])

    def is_death(self, error):
        # Meanwhile the other batches end.
        while self.running:
            self._end_one()
        return isinstance(error, Died)

    def require_alive(self):
        """End a batch, since no further one is submitted."""
        self._end_one()

    def recover(self):
        assert not self.running

    def close(self):
        self.closed = True


def _row(pair):
    return PairRow(
        name=pair.name,
        source=pair.source,
        target=pair.target,
        status="ok",
        reason="",
        extra=pair.extra,
        seconds=0.1,
    )


@pytest.fixture(scope="module", autouse=True)
def short_checks():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(dispatch, "_CHECK_SECONDS", 0.001)
        yield


def _pairs(names):
    return [
        Pair(source="s", target="t", name=name, extra={"number": str(k)})
        for k, name in enumerate(names)
    ]


@given(
    st.lists(st.sampled_from(["good", "good", "good", "killer"]), max_size=40),
    st.integers(0, 3),
    st.booleans(),
)
def test_only_the_pairs_that_end_workers_become_errors(names, choice, shared_fate):
    workers = FakeWorkers(lambda count: choice % count, shared_fate)
    rows = list(Dispatch(iter(_pairs(names)), workers).rows())
    assert [row.extra["number"] for row in rows] == [str(k) for k in range(len(names))]
    assert [row.status for row in rows] == ["error" if name == "killer" else "ok" for name in names]
    assert all(row.error == "WorkerDied" for row in rows if row.status == "error")
    assert workers.closed


def test_other_errors_of_workers_are_raised_and_the_workers_end():
    class Broken(FakeWorkers):
        def submit(self, batch):
            future = Future()
            future.set_exception(ImportError("no scanlock here"))
            return future

    workers = Broken()
    with pytest.raises(ImportError, match="no scanlock"):
        list(Dispatch(iter(_pairs(["a"])), workers).rows())
    assert workers.closed


def test_workers_end_when_the_iteration_stops_early():
    workers = FakeWorkers()
    endless = (Pair(source="s", target="t", name=str(k)) for k in itertools.count())
    rows = Dispatch(endless, workers).rows()
    assert [next(rows).name for _ in range(10)] == [str(k) for k in range(10)]
    rows.close()
    assert workers.closed


def test_rows_that_wait_for_an_earlier_one_are_bounded():
    # The first batch never ends.
    workers = FakeWorkers(lambda count: count - 1)
    read = itertools.count()
    endless = (Pair(source="s", target="t", name=str(next(read))) for _ in itertools.count())
    dispatch = Dispatch(endless, workers)
    for _ in range(2000):
        dispatch._feed()
        if dispatch._ended.empty():
            break
        dispatch._collect(dispatch._ended.get())
    assert dispatch._ended.empty()
    assert len(dispatch._rows) < next(read) < 5000


def test_a_run_without_workers_ends_with_an_error():
    class Lost(FakeWorkers):
        def submit(self, batch):
            return Future()  # never ends

        def require_alive(self):
            raise WorkersLost("no worker")

    with pytest.raises(WorkersLost, match="no worker"):
        list(Dispatch(iter([Pair(source="a.bin", target="b.bin")]), Lost()).rows())


def test_a_cluster_without_workers_is_lost_after_five_minutes():
    workers = object.__new__(ClusterWorkers)
    threads = {}
    workers._client = SimpleNamespace(nthreads=lambda: threads)
    workers._empty_checks = 0
    for _ in range(29):
        workers.require_alive()
    threads["worker"] = 1
    workers.require_alive()
    threads.clear()
    for _ in range(29):
        workers.require_alive()
    with pytest.raises(WorkersLost, match="start workers"):
        workers.require_alive()
