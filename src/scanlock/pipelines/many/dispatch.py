"""Distribution of batches to workers: fed ahead, in order, with lost batches run again."""

from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from queue import Empty, SimpleQueue

from scanlock.errors import ScanlockError
from scanlock.pipelines.many.batches import Batch, Batches, BatchSize
from scanlock.pipelines.many.pair import Pair
from scanlock.pipelines.many.pair_row import PairRow, row_of_error
from scanlock.pipelines.many.work import path_text
from scanlock.pipelines.many.workers import Running, Workers

_MAX_HELD_BATCHES = 50
"""Maximum number of batches, for each worker, between the next row and the last batch started."""

_CHECK_SECONDS = 10.0
"""Time between checks of the workers while no batch ends [s]."""


class WorkerDied(ScanlockError):
    """A worker process died while it registered a pair."""


class Dispatch:
    """One run over a list of pairs.

    Parameters
    ----------
    pairs : iterator of Pair
    workers : Workers
    """

    def __init__(self, pairs: Iterator[Pair], workers: Workers) -> None:
        self._workers = workers
        self._batches = Batches(pairs)
        self._size = BatchSize(workers.first_size, workers.batch_seconds)
        self._running: dict[Running, Batch] = {}
        self._suspects = deque[Batch]()
        self._ended = SimpleQueue[Running]()
        self._rows: dict[int, PairRow] = {}
        self._next = 0

    def rows(self) -> Iterator[PairRow]:
        """Yield a row for each pair, in order; the workers end with the iterator."""
        try:
            while self._feed():
                self._collect(self._next_ended())
                while self._next in self._rows:
                    self._next += 1
                    yield self._rows.pop(self._next - 1)
        finally:
            self._workers.close()

    def _next_ended(self) -> Running:
        """Wait for a batch to end; raise if no worker is left to end it."""
        while True:
            try:
                return self._ended.get(timeout=_CHECK_SECONDS)
            except Empty:
                self._workers.require_alive()

    def _feed(self) -> bool:
        """Start batches; return whether any is running."""
        if self._suspects:
            # Alone, so that it is certain which batch ends a worker.
            if not self._running:
                self._workers.recover()
                self._start(self._suspects.popleft())
            return True
        workers = self._workers.count()
        while len(self._running) < workers * self._workers.ahead and self._has_room(workers):
            batch = self._batches.next(self._size.pairs, workers)
            if batch is None:
                break
            self._start(batch)
        return bool(self._running)

    def _has_room(self, workers: int) -> bool:
        return len(self._rows) < _MAX_HELD_BATCHES * workers * self._size.pairs

    def _start(self, batch: Batch) -> None:
        running = self._workers.submit(batch)
        self._running[running] = batch
        running.add_done_callback(self._ended.put)

    def _collect(self, ended: Running) -> None:
        batch = self._running.pop(ended)
        error = ended.exception()
        if error is None:
            rows = ended.result()
            self._rows.update(zip(batch.numbers, rows, strict=True))
            self._size.adapt(rows)
        elif self._workers.is_death(error):
            self._suspects.extend(self._after_death(batch))
        else:
            raise error

    def _after_death(self, batch: Batch) -> list[Batch]:
        """Return what to run again of a batch whose worker died."""
        count = len(batch.pairs)
        # A cluster has run the batch again by itself, so it is split at once.
        if not batch.is_suspect and (count == 1 or self._workers.max_deaths > 1):
            return [replace(batch, is_suspect=True)]
        if count > 1:
            return [batch.part(0, count // 2), batch.part(count // 2, count)]
        batch = replace(batch, deaths=batch.deaths + 1)
        if batch.deaths < self._workers.max_deaths:
            return [batch]
        [number], [pair] = batch.numbers, batch.pairs
        error = WorkerDied(
            "the worker process died while it registered this pair; its memory may be too small"
        )
        scans = path_text(pair.source), path_text(pair.target)
        self._rows[number] = row_of_error(pair.name, scans, error, pair.extra)
        return []
