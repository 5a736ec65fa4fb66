"""Threads and processes: how many share the work, or call at once, changes no bit."""

import multiprocessing
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from contracts.traits import source, target
from scanlock.registration.register import register
from scanlock.registration.registry import METHODS

pytestmark = pytest.mark.parametrize("method", METHODS)


def _bytes(method, threads=1):
    found = register(source=source(method), target=target(), method=method, threads=threads)
    numbers = [found.overlap, found.score, *(step.value for step in found.history)]
    return found.target_from_source.matrix.tobytes() + np.array(numbers).tobytes()


@pytest.fixture
def alone(method):
    return _bytes(method)


def test_sharing_threads_give_the_bits_of_one(method, alone):
    for threads in (2, 3):
        assert _bytes(method, threads) == alone


def test_calls_from_many_threads_at_once_give_the_bits_of_one(method, alone):
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda k: _bytes(method, 1 + k % 2), range(8)))
    assert set(found) == {alone}


def _put(queue, method):
    queue.put(_bytes(method, 2))


@pytest.mark.skipif(
    "fork" not in multiprocessing.get_all_start_methods(), reason="this system cannot fork"
)
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_a_process_forked_from_one_that_used_threads_gives_the_same_bits(method, alone):
    assert _bytes(method, 2) == alone
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    children = [context.Process(target=_put, args=(queue, method)) for _ in range(2)]
    for child in children:
        child.start()
    assert {queue.get(timeout=60.0) for _ in children} == {alone}
    for child in children:
        child.join(timeout=60.0)
        assert child.exitcode == 0
