import os
import threading
from dataclasses import dataclass

import numpy as np
import pytest

from scanlock.pipelines.many.scan_cache import ScanCache, file_key, memory_of


@dataclass(frozen=True, slots=True)
class Holder:
    array: np.ndarray
    others: tuple = ()


def _make(made, key, kilobytes=1):
    def make():
        made.append(key)
        return Holder(np.zeros(128 * kilobytes))

    return make


def test_the_least_recently_used_scans_are_dropped():
    cache, made = ScanCache(3 * 1024), []
    for key in "abcabdab":
        cache.get(key, _make(made, key))
    assert made == ["a", "b", "c", "d"]
    cache.get("c", _make(made, "c"))
    assert made[-1] == "c"


def test_a_scan_larger_than_the_bound_is_returned_but_not_kept():
    cache, made = ScanCache(1024), []
    assert cache.get("a", _make(made, "a", 2)).array.nbytes == 2048
    cache.get("a", _make(made, "a", 2))
    assert made == ["a", "a"]


def test_an_error_is_raised_and_the_next_try_makes_the_scan_again():
    cache, tries = ScanCache(1024), []

    def fail():
        tries.append(1)
        raise OSError("gone")

    for _ in range(2):
        with pytest.raises(OSError, match="gone"):
            cache.get("a", fail)
    assert len(tries) == 2
    assert cache.get("a", lambda: "scan") == "scan"


def test_two_threads_that_ask_for_a_scan_make_it_once():
    cache, made, start = ScanCache(1 << 20), [], threading.Barrier(4)

    def ask():
        start.wait()
        cache.get("a", _make(made, "a"))

    threads = [threading.Thread(target=ask) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert made == ["a"]


def test_memory_counts_arrays_once_and_views_as_their_base():
    array = np.zeros(1000)
    held = Holder(array, (array, array[:3], {"key": [np.zeros(10)]}, "text", None))
    assert memory_of(held) == 8000 + 80


def test_the_key_of_a_file_changes_when_it_is_written_again(tmp_path):
    path = tmp_path / "scan.npy"
    path.write_bytes(b"one")
    first = file_key(str(path))
    assert file_key(str(path)) == first
    os.utime(path, ns=(1, 1))
    assert file_key(str(path)) != first
