"""Prepared scans that several pairs share, bounded by their memory."""

import dataclasses
import os
import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterable
from typing import Any

import numpy as np

from scanlock.registration.prepare import PreparedScan


class ScanCache:
    """Prepared scans by key; the least recently used are dropped first.

    Several threads may ask at once; a scan is then prepared by one, and the others wait for it.

    Parameters
    ----------
    max_bytes : int
        Bound on the memory of the prepared scans; at least the last one is kept during its use.
    """

    def __init__(self, max_bytes: int) -> None:
        self._max_bytes = max_bytes
        self._bytes = 0
        self._scans: OrderedDict[Hashable, tuple[PreparedScan, int]] = OrderedDict()
        self._lock = threading.Lock()
        self._busy: dict[Hashable, threading.Lock] = {}

    def get(self, key: Hashable, make: Callable[[], PreparedScan]) -> PreparedScan:
        """Return the scan of a key, prepared by `make` unless it is held; errors are not held."""
        with self._lock:
            busy = self._busy.setdefault(key, threading.Lock())
        try:
            with busy:
                found = self._held(key)
                if found is None:
                    found = make()
                    self._hold(key, found)
        finally:
            with self._lock:
                self._busy.pop(key, None)
        return found

    def _held(self, key: Hashable) -> PreparedScan | None:
        with self._lock:
            if key not in self._scans:
                return None
            self._scans.move_to_end(key)
            return self._scans[key][0]

    def _hold(self, key: Hashable, scan: PreparedScan) -> None:
        size = memory_of(scan)
        with self._lock:
            self._scans[key] = scan, size
            self._bytes += size
            while self._bytes > self._max_bytes and self._scans:
                self._bytes -= self._scans.popitem(last=False)[1][1]


def file_key(path: str) -> Hashable:
    """Return a key of a file that changes when the file is written again."""
    stat = os.stat(path)
    return os.path.abspath(path), stat.st_mtime_ns, stat.st_size


def memory_of(value: Any) -> int:
    """Return the bytes of all arrays that an object of dataclasses and containers holds."""
    total, seen, waiting = 0, set[int](), [value]
    while waiting:
        one = waiting.pop()
        if isinstance(one, np.ndarray):
            while isinstance(one.base, np.ndarray):
                one = one.base
        if id(one) in seen:
            continue
        seen.add(id(one))
        if isinstance(one, np.ndarray):
            total += one.nbytes
        else:
            waiting.extend(_parts(one))
    return total


def _parts(value: Any) -> Iterable[Any]:
    if isinstance(value, str | bytes | int | float | type):
        return ()
    if isinstance(value, dict):
        return value.values()
    if isinstance(value, tuple | list | set | frozenset):
        return value
    named = list(getattr(value, "__dict__", {}).values())
    if dataclasses.is_dataclass(value):
        named += [getattr(value, one.name, None) for one in dataclasses.fields(value)]
    return named
