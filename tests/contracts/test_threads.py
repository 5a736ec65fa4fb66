"""Results are identical for any number of threads and processes."""

import multiprocessing
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from contracts.traits import source, target
from scanlock.registration.register import register
from scanlock.registration.registry import METHODS

pytestmark = [pytest.mark.slow, pytest.mark.parametrize("method", METHODS)]


def _result_bytes(method, threads=1):
    found = register(source=source(method), target=target(), method=method, threads=threads)
    numbers = [found.overlap, found.score, *(step.value for step in found.history)]
    return found.target_from_source.matrix.tobytes() + np.array(numbers).tobytes()


@pytest.fixture
def alone(method):
    return _result_bytes(method)


def test_several_threads_give_identical_results(method, alone):
    for threads in (2, 3):
        assert _result_bytes(method, threads) == alone


def test_concurrent_calls_from_threads_give_identical_results(method, alone):
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda k: _result_bytes(method, 1 + k % 2), range(8)))
    assert set(found) == {alone}


def _put_result(queue, method):
    queue.put(_result_bytes(method, 2))


@pytest.mark.skipif(
    "fork" not in multiprocessing.get_all_start_methods(), reason="this system cannot fork"
)
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_a_process_forked_after_the_use_of_threads_gives_identical_results(method, alone):
    assert _result_bytes(method, 2) == alone
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    children = [context.Process(target=_put_result, args=(queue, method)) for _ in range(2)]
    for child in children:
        child.start()
    assert {queue.get(timeout=60.0) for _ in children} == {alone}
    for child in children:
        child.join(timeout=60.0)
        assert child.exitcode == 0
