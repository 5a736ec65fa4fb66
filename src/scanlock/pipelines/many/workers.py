"""Workers on this machine: the calling thread, a thread pool, or a pool of processes."""

import multiprocessing
import os
from collections.abc import Callable, Generator
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any, Protocol

from scanlock.interrupts import children_ignore_interrupts
from scanlock.pipelines.many.batches import Batch
from scanlock.pipelines.many.pair_row import PairRow
from scanlock.pipelines.many.scan_cache import ScanCache
from scanlock.pipelines.many.work import Job, register_batch, register_batch_elsewhere

_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


class Running(Protocol):
    """A batch that is running, as a future of any library."""

    def add_done_callback(self, fn: Callable[[Any], object], /) -> object:
        """Call a function at the end."""
        ...

    def exception(self) -> BaseException | None:
        """Return the error of the batch, if any."""
        ...

    def result(self) -> list[PairRow]:
        """Return the rows of the batch."""
        ...


class Workers(Protocol):
    """Where batches run."""

    @property
    def first_size(self) -> int:
        """Number of pairs of the first batches."""
        ...

    @property
    def batch_seconds(self) -> float:
        """Intended duration of a batch [s]."""
        ...

    @property
    def ahead(self) -> int:
        """Number of batches that a worker has at once, the running one included."""
        ...

    @property
    def max_deaths(self) -> int:
        """Number of workers that a pair alone must end to become an error; 1 with own retries."""
        ...

    def count(self) -> int:
        """Return the number of batches that can run at once."""
        ...

    def submit(self, batch: Batch) -> Running:
        """Start a batch."""
        ...

    def is_death(self, error: BaseException) -> bool:
        """Return whether a batch failed because its worker died."""
        ...

    def require_alive(self) -> None:
        """Raise if no worker is left, and none will come."""
        ...

    def recover(self) -> None:
        """Replace dead workers; no batch is running."""
        ...

    def close(self) -> None:
        """End the workers, without batches that have not started."""
        ...


class CallerWorkers:
    """The calling thread, one pair at a time."""

    first_size, batch_seconds, ahead, max_deaths = 1, 0.0, 1, 1

    def __init__(self, job: Job) -> None:
        self._job, self._cache = job, ScanCache(job.cache_bytes)

    def count(self) -> int:
        """Return 1."""
        return 1

    def submit(self, batch: Batch) -> Running:
        """Register a batch at once."""
        future = Future[list[PairRow]]()
        future.set_result(register_batch(self._job, batch.pairs, self._cache))
        return future

    def is_death(self, error: BaseException) -> bool:
        """Return False."""
        return False

    def require_alive(self) -> None:
        """Do nothing: these workers are started again when they are lost."""

    def recover(self) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""


class ThreadWorkers:
    """Threads of this process, which share prepared scans."""

    first_size, batch_seconds, ahead, max_deaths = 1, 0.5, 2, 1

    def __init__(self, job: Job, count: int) -> None:
        self._job, self._count = job, count
        self._cache = ScanCache(job.cache_bytes)
        self._pool: Executor = ThreadPoolExecutor(count, thread_name_prefix="scanlock-pairs")

    def count(self) -> int:
        """Return the number of threads."""
        return self._count

    def submit(self, batch: Batch) -> Running:
        """Start a batch."""
        return self._pool.submit(register_batch, self._job, batch.pairs, self._cache)

    def is_death(self, error: BaseException) -> bool:
        """Return False: a thread does not die alone."""
        return False

    def require_alive(self) -> None:
        """Do nothing: these workers are started again when they are lost."""

    def recover(self) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Wait for the running batches and drop the others."""
        self._pool.shutdown(wait=True, cancel_futures=True)


class ProcessWorkers:
    """Processes of this machine, one thread each."""

    first_size, batch_seconds, ahead, max_deaths = 4, 0.5, 3, 2

    def __init__(self, job: Job, count: int) -> None:
        self._job, self._count = job, count
        self._pool, self._starts = self._new_pool(), 0

    def count(self) -> int:
        """Return the number of processes."""
        return self._count

    def submit(self, batch: Batch) -> Running:
        """Start a batch, and a process unless all are running."""
        if self._starts >= self._count:
            return self._pool.submit(register_batch_elsewhere, self._job, batch.pairs)
        self._starts += 1
        with _one_thread_each(), children_ignore_interrupts():
            return self._pool.submit(register_batch_elsewhere, self._job, batch.pairs)

    def is_death(self, error: BaseException) -> bool:
        """Return whether a process died; the pool then fails all its batches."""
        return isinstance(error, BrokenProcessPool)

    def require_alive(self) -> None:
        """Do nothing: these workers are started again when they are lost."""

    def recover(self) -> None:
        """Replace the processes."""
        self.close()
        self._pool, self._starts = self._new_pool(), 0

    def close(self) -> None:
        """Wait for the running batches and drop the others."""
        self._pool.shutdown(wait=True, cancel_futures=True)

    def _new_pool(self) -> Executor:
        # Spawned, since a forked process would inherit locks that threads of this one hold.
        return ProcessPoolExecutor(self._count, multiprocessing.get_context("spawn"))


def core_count() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextmanager
def _one_thread_each() -> Generator[None]:
    """Let processes started in the ``with`` block use one thread for linear algebra."""
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
