"""The work of one batch of pairs, in whichever thread, process or machine it runs."""

import functools
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from scanlock.errors import FormatError
from scanlock.io import read_pose_matrix, read_scan
from scanlock.io.columns import Columns
from scanlock.optimisation.objectives.constraints import DegreesOfFreedom
from scanlock.pipelines.many.pair import InitialPose, Pair, ScanSource
from scanlock.pipelines.many.pair_row import PairRow, row_of_error, row_of_result
from scanlock.pipelines.many.scan_cache import ScanCache, file_key
from scanlock.registration.methods.protocol import Method
from scanlock.registration.prepare import PreparedScan, prepared_as
from scanlock.registration.register import register
from scanlock.registration.uncertainty.covariance_estimator import CovarianceEstimator

ReadPoints = Callable[[Path], ArrayLike]
"""Reader of the points of a scan file."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Job:
    """What is the same for all pairs of a list."""

    key: str
    """Random text by which a worker knows the job again."""

    method: str | Method[Any]
    """Method of all registrations."""

    dof: DegreesOfFreedom
    """Degrees of freedom of all registrations."""

    covariance: CovarianceEstimator | None
    """How to estimate covariances."""

    verify: bool
    """Whether to verify the poses."""

    read: ReadPoints
    """Reader of scan files."""

    cache_bytes: int
    """Bound on the memory of prepared scans in each process."""


def read_points(
    path: Path,
    *,
    format: str | None = None,
    columns: Columns = None,
    scale: float | None = None,
) -> ArrayLike:
    """Read the points of a scan file without rows at (0, 0, 0), which mark missing returns.

    Raises
    ------
    InvalidInput
        Coordinates in degrees.
    FormatError
        No point is finite and not (0, 0, 0), or an error of `read_scan`.
    """
    file = read_scan(path, format, columns=columns, scale=scale)
    if file.crs is not None:
        file.crs.require_lengths(str(path))
    points = file.points
    blank = (points == 0.0).all(axis=1)
    if blank.any():
        points = points[~blank]
    if not np.isfinite(points).all(axis=1).any():
        raise FormatError(
            f"{path}: none of its {len(blank):,} points is finite and not (0, 0, 0); check the "
            "program that wrote it"
        )
    return points


def register_batch(job: Job, pairs: Sequence[Pair], cache: ScanCache) -> list[PairRow]:
    """Register pairs one after the other and return a row for each; errors become rows."""
    return [_row(job, pair, cache) for pair in pairs]


def register_batch_elsewhere(job: Job, pairs: Sequence[Pair]) -> list[PairRow]:
    """Register a batch in another process, whose prepared scans are kept between its batches."""
    return register_batch(job, pairs, _cache_of(job.key, job.cache_bytes))


@functools.lru_cache(maxsize=1)
def _cache_of(key: str, max_bytes: int) -> ScanCache:
    return ScanCache(max_bytes)


def _row(job: Job, pair: Pair, cache: ScanCache) -> PairRow:
    begin = time.perf_counter()
    scans = path_text(pair.source), path_text(pair.target)
    try:
        target = _prepared(job, "target", pair.target, cache)
        source = _prepared(job, "source", pair.source, cache)
        result = register(
            source=source,
            target=target,
            initial=_initial(pair.initial),
            dof=job.dof,
            covariance=job.covariance or False,
            verify=job.verify,
        )
        row = row_of_result(pair.name, scans, result, pair.extra)
    except Exception as error:
        # Even an unforeseen error must not lose the other pairs.
        row = row_of_error(pair.name, scans, error, pair.extra)
    return replace(row, seconds=time.perf_counter() - begin)


def _prepared(job: Job, role: str, scan: ScanSource, cache: ScanCache) -> PreparedScan:
    if not isinstance(scan, str | os.PathLike):
        return prepared_as(role, scan, job.method, job.verify)
    path = os.fspath(scan)
    return cache.get(
        file_key(path),
        lambda: prepared_as(path, job.read(Path(path)), job.method, job.verify),
    )


def _initial(initial: InitialPose | None) -> Any:
    return read_pose_matrix(initial) if isinstance(initial, str | os.PathLike) else initial


def path_text(scan: ScanSource) -> str:
    """Return the path of a scan; empty for an array."""
    return os.fspath(scan) if isinstance(scan, str | os.PathLike) else ""
