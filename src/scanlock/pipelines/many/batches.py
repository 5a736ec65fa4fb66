"""Batches of pairs: their order, their size and the pairs that are read ahead."""

import itertools
import math
from collections import defaultdict, deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from scanlock.pipelines.many.pair import Pair
from scanlock.pipelines.many.pair_row import PairRow

_MAX_ARRAY_BYTES = 256 << 20
"""Bytes of arrays that are read ahead at a time; paths have no such bound."""

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
        self._waiting = deque[Batch]()

    def next(self, size: int, workers: int) -> Batch | None:
        """Return the next batch; None at the end of the list.

        Pairs are read for one batch of `size` per worker at a time, and ordered so that the pairs
        of a batch share scans.
        """
        if not self._waiting:
            taken = list(_up_to(self._pairs, size * workers))
            taken = [taken[row] for row in sharing_order([pair for _, pair in taken])]
            each = max(1, min(size, math.ceil(len(taken) / workers)))
            for begin in range(0, len(taken), each):
                numbers, pairs = zip(*taken[begin : begin + each], strict=True)
                self._waiting.append(Batch(numbers=numbers, pairs=pairs))
        return self._waiting.popleft() if self._waiting else None


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


def _up_to(pairs: Iterable[tuple[int, Pair]], count: int) -> Iterator[tuple[int, Pair]]:
    size = 0
    for number, pair in itertools.islice(pairs, count):
        yield number, pair
        for scan in (pair.source, pair.target):
            size += scan.nbytes if isinstance(scan, np.ndarray) else 0
        if size > _MAX_ARRAY_BYTES:
            return
