"""Registration of a list of pairs in threads, processes or a cluster."""

from __future__ import annotations

import secrets
from collections.abc import Iterable
from typing import Any, Literal

from scanlock.errors import InvalidInput, require_count
from scanlock.optimisation.objectives.constraints import Constraints, DegreesOfFreedom
from scanlock.pipelines.many.cluster import ClusterWorkers, is_address, is_client
from scanlock.pipelines.many.dispatch import Dispatch
from scanlock.pipelines.many.pair import Pair, ScanSource, pair_of
from scanlock.pipelines.many.pair_row import PairRows
from scanlock.pipelines.many.work import Job, ReadPoints, read_points
from scanlock.pipelines.many.workers import (
    CallerWorkers,
    ProcessWorkers,
    ThreadWorkers,
    Workers,
    core_count,
)
from scanlock.registration.methods.protocol import Method
from scanlock.registration.registry import DEFAULT_METHOD, named_method
from scanlock.registration.uncertainty.covariance_estimator import (
    CovarianceEstimator,
    chosen_estimator,
)
from scanlock.registration.uncertainty.pose_covariance import CovarianceMethod

Executor = Literal["threads", "processes"] | str | Any | None
"""Where pairs are registered: see `register_many`."""


def register_many(
    pairs: Iterable[Pair | tuple[ScanSource, ScanSource]],
    *,
    method: str | Method[Any] = DEFAULT_METHOD,
    dof: DegreesOfFreedom = "xyz+rpy",
    covariance: bool | CovarianceMethod | CovarianceEstimator = False,
    verify: bool = True,
    executor: Executor = "threads",
    workers: int | None = None,
    read: ReadPoints = read_points,
    cache_bytes: int = 512 << 20,
) -> PairRows:
    """Register many pairs and return an iterator over their rows, in order.

    A scan that cannot be read or registered becomes a row with the status ``"error"`` and does
    not stop the others. Rows are the same for every executor and number of workers, except for
    their times. The list may be a generator of any length: only a few pairs are read ahead.

    Parameters
    ----------
    pairs : iterable of Pair or tuple
        A pair, or its source and target: paths of scans, or points as for `register`. A scan that
        is given by its path and occurs in several pairs is prepared once per process while its
        memory suffices. Pairs with common scans should be neighbours.
    method : str or Method
        As for `register`.
    dof : str
        As for `register`.
    covariance : bool or str or CovarianceEstimator
        As for `register`, but left out by default.
    verify : bool
        As for `register`.
    executor : {"threads", "processes"}, address, distributed.Client or None
        Threads of this process; new processes, for which a script needs the usual
        ``if __name__ == "__main__":``; a Dask cluster, by the address of its scheduler such as
        ``"tcp://host:8786"``; or None for the calling thread.
    workers : int, optional
        Number of threads or processes; by default the number of cores. Each uses one core.
    read : callable
        Reader of scan files; by default `read_scan`, without points at (0, 0, 0). For processes
        and clusters it must be a function of a module.
    cache_bytes : int
        Bound on the memory of prepared scans in each process.

    Returns
    -------
    PairRows
        Iterator over `PairRow`; ``to_dicts()`` returns them all, for ``pandas.DataFrame``.

    Raises
    ------
    InvalidInput
        An unknown method, executor or option, or, during the iteration, an item of `pairs` that is
        not a pair.
    MissingExtra
        A cluster without Dask installed.
    """
    require_count("cache_bytes", cache_bytes, 0)
    Constraints(dof=dof)
    estimator = chosen_estimator(covariance)
    name, chosen = named_method(method)
    job = Job(
        key=secrets.token_hex(8),
        # By its name, where it has one, since rows show the name.
        method=name if isinstance(method, str) else chosen,
        dof=dof,
        covariance=estimator,
        verify=verify,
        read=read,
        cache_bytes=cache_bytes,
    )
    numbered = (pair_of(item, number) for number, item in enumerate(pairs))
    return PairRows(Dispatch(numbered, _workers(job, executor, workers)).rows())


def _workers(job: Job, executor: Executor, count: int | None) -> Workers:
    if count is not None:
        require_count("workers", count, 1)
    if executor is None:
        return CallerWorkers(job)
    if executor == "threads":
        return ThreadWorkers(job, count or core_count())
    if executor == "processes":
        return ProcessWorkers(job, count or core_count())
    if not is_address(executor) and not is_client(executor):
        raise InvalidInput(
            "executor must be 'threads', 'processes', None or the address of a Dask scheduler "
            f"such as 'tcp://host:8786', got {executor!r}"
        )
    if count is not None:
        raise InvalidInput(
            f"workers must be None for a cluster, got {count}; choose it where the cluster starts"
        )
    return ClusterWorkers(job, executor)
