"""Batches of pairs: their order, their size and the pairs that are read ahead."""

import itertools
import math
from collections import defaultdict, deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from scanlock.pipelines.many.pair import Pair
from scanlock.pipelines.many.pair_row import PairRow

_MAX_ARRAY_BYTES = 256 << 20
"""Bytes of arrays that wait for a batch; paths have no such bound."""

_LAST_PARTS = 20
"""Ratio of the size of a batch to that of the last one."""

_MAX_PAIRS = 1000
"""Maximum number of pairs of a batch."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Batch:
    """Pairs that one worker registers in one go."""

    numbers: tuple[int, ...]
    """Position of each pair in the list."""

    pairs: tuple[Pair, ...]
    """The pairs."""

    is_suspect: bool = False
    """Whether a worker died with this batch."""

    deaths: int = 0
    """Number of workers that died while this batch alone was running."""

    def part(self, begin: int, end: int) -> "Batch":
        """Return a suspect batch of some of the pairs."""
        return Batch(numbers=self.numbers[begin:end], pairs=self.pairs[begin:end], is_suspect=True)


class BatchSize:
    """Number of pairs of a batch, adapted so that a batch takes about `seconds`.

    Parameters
    ----------
    first : int
        Number of pairs of the first batches.
    seconds : float
        Intended duration of a batch [s].
    """

    def __init__(self, first: int, seconds: float) -> None:
        self.pairs = first
        self._seconds = seconds

    def adapt(self, rows: Sequence[PairRow]) -> None:
        """Adapt the size to the measured times of a batch, at most twofold at a time."""
        mean = sum(row.seconds or 0.0 for row in rows) / len(rows)
        wanted = math.ceil(self._seconds / max(mean, 1e-4))
        self.pairs = max(1, min(wanted, 2 * self.pairs, _MAX_PAIRS))


class Batches:
    """Batches of a list of pairs, of which only a few are read ahead.

    Parameters
    ----------
    pairs : iterator of Pair
    """

    def __init__(self, pairs: Iterator[Pair]) -> None:
        self._pairs = enumerate(pairs)
        self._waiting = deque[tuple[int, Pair]]()
        self._bytes = 0
        self._has_ended = False

    def next(self, size: int, workers: int) -> Batch | None:
        """Return the next batch; None at the end of the list.

        Pairs are read in rounds of one batch of `size` per worker, two rounds ahead, and ordered
        so that the pairs of a batch share scans. The last batches become smaller and smaller, so
        that all workers end at about the same time.
        """
        count = size * workers
        while not self._has_ended and len(self._waiting) <= count:
            if self._bytes >= _MAX_ARRAY_BYTES:
                break
            self._read(count)
        if not self._waiting:
            return None
        waiting = len(self._waiting)
        if self._has_ended:
            each = max(math.ceil(waiting / (2 * workers)), math.ceil(size / _LAST_PARTS))
        else:
            each = math.ceil(waiting / workers)
        taken = [self._waiting.popleft() for _ in range(min(each, size, waiting))]
        self._bytes -= sum(_array_bytes(pair) for _, pair in taken)
        numbers, pairs = zip(*taken, strict=True)
        return Batch(numbers=numbers, pairs=pairs)

    def _read(self, count: int) -> None:
        """Read up to a number of pairs, in an order in which neighbours share scans."""
        found: list[tuple[int, Pair]] = []
        for one in itertools.islice(self._pairs, count):
            found.append(one)
            self._bytes += _array_bytes(one[1])
            if self._bytes >= _MAX_ARRAY_BYTES:
                break
        else:
            self._has_ended = len(found) < count
        order = sharing_order([pair for _, pair in found])
        self._waiting.extend(found[row] for row in order)


def sharing_order(pairs: Sequence[Pair]) -> list[int]:
    """Return an order of pairs in which neighbours share scans: breadth first, in list order."""
    users = defaultdict[Any, list[int]](list)
    for row, pair in enumerate(pairs):
        for scan in (pair.target, pair.source):
            users[_identity(scan)].append(row)
    order: list[int] = []
    seen = set[int]()
    for first in range(len(pairs)):
        queue = deque([first])
        while queue:
            row = queue.popleft()
            if row in seen:
                continue
            seen.add(row)
            order.append(row)
            for scan in (pairs[row].target, pairs[row].source):
                # Each list is needed once: after that, all its pairs are queued or ordered.
                queue.extend(users.pop(_identity(scan), ()))
    return order


def _identity(scan: object) -> Any:
    return str(scan) if isinstance(scan, str) or hasattr(scan, "__fspath__") else id(scan)


def _array_bytes(pair: Pair) -> int:
    scans = (pair.source, pair.target)
    return sum(scan.nbytes for scan in scans if isinstance(scan, np.ndarray))
