"""Workers of a Dask cluster."""

import importlib
from typing import Any

from scanlock.errors import InvalidInput, MissingExtra, ScanlockError
from scanlock.pipelines.many.batches import Batch
from scanlock.pipelines.many.work import Job, register_batch_elsewhere
from scanlock.pipelines.many.workers import Running

_PROTOCOLS = ("tcp://", "tls://", "ws://", "wss://", "ucx://")


_MAX_EMPTY_CHECKS = 30
"""Maximum number of checks in a row without a worker, ten seconds apart."""


class WorkersLost(ScanlockError):
    """No worker of a cluster is left."""


class ClusterWorkers:
    """Workers of a Dask scheduler, by its address or a `distributed.Client`.

    Each batch is one task, of about ten seconds, since a task costs the scheduler about a
    millisecond. Scans given by their paths are read where the worker is.
    """

    first_size, batch_seconds, ahead, max_deaths = 20, 10.0, 2, 1

    def __init__(self, job: Job, executor: Any) -> None:
        distributed = _distributed()
        self._job, self._batches = job, 0
        self._killed: type[BaseException] = distributed.scheduler.KilledWorker
        self._owns_client = isinstance(executor, str)
        self._client: Any = _client(distributed, executor) if self._owns_client else executor
        self._running = set[Any]()
        self._empty_checks = 0

    def count(self) -> int:
        """Return the number of threads of all workers, which may change; at least 1."""
        return max(1, sum(self._client.nthreads().values()))

    def submit(self, batch: Batch) -> Running:
        """Send a batch to the scheduler."""
        self._batches += 1
        future = self._client.submit(
            register_batch_elsewhere,
            self._job,
            batch.pairs,
            key=f"register_many-{self._job.key}-{self._batches}",
            pure=False,
        )
        self._running.add(future)
        future.add_done_callback(self._running.discard)
        return future

    def is_death(self, error: BaseException) -> bool:
        """Return whether more workers died with a batch than the scheduler allows."""
        return isinstance(error, self._killed)

    def require_alive(self) -> None:
        """Raise `WorkersLost` if the cluster has had no worker for five minutes."""
        self._empty_checks = 0 if self._client.nthreads() else self._empty_checks + 1
        if self._empty_checks >= _MAX_EMPTY_CHECKS:
            raise WorkersLost(
                "the cluster has had no worker for five minutes; start workers, and register the "
                "other pairs (--resume at the command line)"
            )

    def recover(self) -> None:
        """Do nothing: the nannies of Dask start workers again."""

    def close(self) -> None:
        """Cancel the batches and leave the cluster as it is."""
        self._client.cancel(list(self._running), force=True)
        if self._owns_client:
            self._client.close()


def is_address(executor: object) -> bool:
    """Return whether an executor is the address of a Dask scheduler."""
    return isinstance(executor, str) and executor.startswith(_PROTOCOLS)


def is_client(executor: object) -> bool:
    """Return whether an executor is a `distributed.Client`, without importing Dask."""
    return hasattr(executor, "submit") and hasattr(executor, "nthreads")


def _distributed() -> Any:
    try:
        return importlib.import_module("distributed")
    except ImportError as error:
        raise MissingExtra(
            "a cluster needs Dask: pip install 'scanlock[cluster]', here and on its workers"
        ) from error


def _client(distributed: Any, address: str) -> Any:
    try:
        return distributed.Client(address, timeout="10s", set_as_default=False)
    except (OSError, ValueError) as error:
        raise InvalidInput(
            f"executor must be the address of a running Dask scheduler, got {address}, where none "
            "answers; start one with: dask scheduler"
        ) from error
